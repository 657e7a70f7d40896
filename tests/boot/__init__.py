"""gritd in a booted Debian guest: `tests/boot/boot FOLDER`, docs/boot.md."""
