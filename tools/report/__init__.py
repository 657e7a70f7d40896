"""HTML reports: one self-contained file each, without network, script or external font."""
