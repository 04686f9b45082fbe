"""Write the generated pages of docs/reference from the code that they describe.

    python -m tools.reference

command_page   commands.md, from the help texts of the command line
recipe_page    recipes.md, from the dataclasses that keys of recipes and lens files are read as
"""
