# docs/service.md: make deb
. /root/gritd/tests/fresh/common.sh

timed "apt" packages gcc make python3-dev python3-venv
timed "make deb" make deb
dpkg-deb --field dist/*.deb Package Version Architecture Depends Installed-Size

packages lintian
timed "lintian" lintian --fail-on error,warning --allow-root dist/*.deb
