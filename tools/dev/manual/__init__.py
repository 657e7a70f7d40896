"""The manual of the commands, made of their parsers: man pages, and the site's reference."""
