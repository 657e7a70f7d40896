# docs/guide.md: Install
. /root/gritd/tests/fresh/common.sh

timed "apt" packages gcc python3-dev python3-venv
python3 -m venv /opt/gritd
timed "pip wheel" /opt/gritd/bin/pip wheel --quiet --no-deps --wheel-dir dist .
timed "pip install" /opt/gritd/bin/pip install --quiet dist/gritd-*.whl
du -sh /opt/gritd
cd /tmp
timed "gritd demo --seconds 20" sh -c '/opt/gritd/bin/gritd demo --seconds 20 >/tmp/demo.log 2>&1'
tail -n 4 /tmp/demo.log
