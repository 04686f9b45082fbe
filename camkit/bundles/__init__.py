"""The built-in bundles, one file each; `camkit.bundle.reader.find_bundle` knows them by name."""
