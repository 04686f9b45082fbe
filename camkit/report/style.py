"""How the pages of lenses, plates and calibrations look."""

from typing import Final

STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 66em; padding: 0 1em;
  color: #222; background: #fff }
table { border-collapse: collapse; margin: .6em 0; font-size: 13px }
td, th { padding: .2em .7em; text-align: right; border-bottom: 1px solid #ddd }
th { background: #f4f4f4 } td:first-child, th:first-child { text-align: left }
svg { max-width: 100%; height: auto } .note { color: #8a4b00 }
.small { color: #555; font-size: 13px }
.scroll { overflow-x: auto }
"""
