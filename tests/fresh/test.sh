# CONTRIBUTING.md: Set-up
. /root/gritd/tests/fresh/common.sh

timed "apt" packages gcc make python3-dev python3-venv
timed "make venv" make venv
timed "make test" sh -c 'make test >/tmp/test.log 2>&1 || { tail -n 60 /tmp/test.log; exit 1; }'
tail -n 3 /tmp/test.log
