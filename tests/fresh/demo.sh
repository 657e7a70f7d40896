# README: Try it
. /root/gritd/tests/fresh/common.sh

timed "apt" packages gcc make python3-dev python3-venv
timed "make venv" make venv
ls estimator/compiled/*.so
timed "make demo" sh -c 'make demo >/tmp/demo.log 2>&1'
tail -n 22 /tmp/demo.log
