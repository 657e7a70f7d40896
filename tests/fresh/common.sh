# What the steps share: timed WORDS COMMAND…, and the packages that README.md names.
set -eu
cd /root/gritd

timed() {
  words=$1; shift
  start=$(date +%s)
  "$@" || { echo "-- $words: exit $?"; exit 1; }
  echo "-- $words: $(($(date +%s) - start)) s"
}

packages() {
  apt-get update -qq
  apt-get install -y -qq --no-install-recommends "$@" >/tmp/apt.log 2>&1 || { tail -n 20 /tmp/apt.log; exit 1; }
}
