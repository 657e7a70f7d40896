#!/bin/bash
# What is tried in the booted guest; its output is the transcript of docs/boot.md. Runs after each of two boots.
exec > /dev/ttyS0 2>&1
cd /tmp
say() { echo; echo "### $*"; }
pid() { systemctl show -p MainPID --value gritd; }
ada() { runuser -u ada -- "$@"; }
journal() { journalctl -b -u gritd --no-pager -o cat; }
settled() { # the service is up and its socket answers
  for _ in $(seq 300); do
    sleep 1
    [ "$(systemctl is-active gritd)" = active ] && gritd status > /dev/null 2>&1 && return
  done
  echo "never settled"; journal | tail -5
}
bus() {
  ada gritd status --json | python3 -c 'import json, sys
d = json.load(sys.stdin)["devices"]["bus"]
print("  bus", d["state"], *(f"{d[key]} {key}," for key in ("readings", "errors", "lost", "reopened")))'
}

vcan() { modprobe vcan; ip link add dev vcan0 type vcan; ip link set vcan0 up; }

first_boot() {
  say "first boot: $(uname -r), $(systemctl --version | head -1), $(. /etc/os-release; echo "$PRETTY_NAME")"
  vcan
  ip -brief link show vcan0
  chgrp dialout /dev/ttyS1
  chmod 660 /dev/ttyS1
  sed -i 's|/dev/ttyACM0|/dev/ttyS1|; s|channel: can0|channel: vcan0|; s|tick: 250 Hz|tick: 8 Hz|; s|update: 10 Hz|update: 1 Hz|
    s|horizon: 50 ms|horizon: 900 ms|; s|stale_after: 40 ms|stale_after: 2 s|; s|latency: \([12]\) ms|latency: \1 ms\n    stale_after: 2 s|
    /stress_linearisation: {/d; s|^effects:.*|effects: {}|' /etc/gritd/config.yaml
  gritd check-config /etc/gritd/config.yaml | head -1

  say "the unit as installed"
  echo "systemd-analyze verify: '$(systemd-analyze verify /etc/systemd/system/gritd.service 2>&1)'"
  systemd-analyze security gritd --no-pager | tail -1

  say "start"
  grep -E "ttyUSB|ttyACM" /proc/devices
  systemctl start gritd
  echo "exit $?, $(systemctl is-active gritd)"
  python3 /root/in_guest_player.py > /root/player.log 2>&1 &
  settled
  sleep 25

  say "a USB serial adapter (FTDI, emulated): its name, its latency [ms], and the drivers that the unit asked for"
  udevadm settle
  ls /dev/gritd
  cat /sys/bus/usb-serial/devices/ttyUSB0/latency_timer
  grep -E "ttyUSB|ttyACM" /proc/devices

  say "systemctl status"
  systemctl status gritd --no-pager -l | head -10
  ls -ld /run/gritd /run/gritd/gritd.sock

  say "user, threads and their scheduling"
  ps -o user,pid,args -p "$(pid)" | cut -c1-100
  ps -L -o cls,rtprio,comm -p "$(pid)"

  say "gritd status as ada: $(id ada)"
  ada gritd status
  echo "exit $?"
  say "gritd status as stranger, who is not in the group"
  runuser -u stranger -- gritd status
  echo "exit $?"
  say "gritd monitor as ada, on a terminal of 80 by 24, 25 s, then Ctrl-C"
  TERM=xterm ada script -qec "stty rows 24 cols 80; timeout --preserve-status -s INT 25 gritd monitor" /tmp/typescript > /dev/null
  echo "exit $?"
  python3 /root/in_guest_pictures.py /tmp/typescript

  say "CAN error frames on vcan0"
  bus
  for _ in $(seq 20); do cansend vcan0 20000040#0000000000000000; done
  echo "20 error frames sent by cansend: bus-off"
  sleep 3
  bus
  /opt/gritd/bin/python /root/in_guest_errors.py
  sleep 3
  bus

  say "3000 unwanted frames of the id 7FF as fast as cangen sends"
  cangen vcan0 -I 7FF -L 8 -g 0 -n 3000 -i
  sleep 3
  bus

  say "the interface down and up"
  ip link set vcan0 down
  sleep 3
  ip link set vcan0 up
  sleep 12
  journal | grep "device bus" | tail -2
  bus

  say "a second instance, as the user gritd"
  runuser -u gritd -- gritd run --config /etc/gritd/config.yaml --directory /var/lib/gritd
  echo "exit $?; the first: $(systemctl is-active gritd), process $(pid)"

  say "reload: good"
  sed -i 's|value: 2.0 N\*m/A|value: 2.001 N*m/A|' /etc/gritd/config.yaml
  systemctl reload gritd
  echo "exit $?"
  sleep 12
  journal | tail -2

  say "reload: bad"
  cp /etc/gritd/config.yaml /root/good
  echo "rates: {tick: no}" >> /etc/gritd/config.yaml
  systemctl reload gritd
  sleep 12
  journal | tail -1
  cp /root/good /etc/gritd/config.yaml
  systemctl is-active gritd

  for number in 1 2 3; do
    say "kill -9, number $number"
    old=$(pid)
    recording=$(ls -t /var/lib/gritd/*.mcap | head -1)
    killed=$(date +%s%N)
    kill -9 "$old"
    settled
    journal | grep -E "code=killed|Scheduled restart|Started" | tail -3
    echo "was $old, is $(pid), restarts $(systemctl show -p NRestarts --value gritd)"
    /opt/gritd/bin/python /root/in_guest_loss.py "$recording" "$killed"
    sleep 10
    ada gritd status | head -1
  done

  say "watchdog: the process is stopped (SIGSTOP)"
  old=$(pid)
  kill -STOP "$old"
  for _ in $(seq 1200); do sleep 0.1; [ "$(pid)" != "$old" ] && break; done
  settled
  journal | grep -E "Watchdog|Killing|Scheduled restart|Started" | tail -4
  echo "was $old, is $(pid), restarts $(systemctl show -p NRestarts --value gritd)"
  sleep 10

  say "a wrong configuration at start: not tried again"
  cp /etc/gritd/config.yaml /root/good
  echo "rates: {tick: no}" >> /etc/gritd/config.yaml
  systemctl restart gritd
  sleep 20
  echo "$(systemctl is-active gritd): $(systemctl show -p Result,ExecMainStatus,NRestarts gritd | xargs)"
  cp /root/good /etc/gritd/config.yaml
  systemctl start gritd
  settled
  systemctl is-active gritd
  sleep 10

  say "stop"
  systemctl stop gritd
  systemctl show -p Result,ExecMainStatus gritd
  journal | grep "log closed" | tail -1

  say "enable and reboot"
  systemctl enable gritd
  touch /root/second
  systemctl reboot
}

second_boot() {
  say "second boot: the service is enabled, and up before the CAN interface is"
  sleep 20
  vcan
  settled
  echo "$(systemctl is-active gritd), $(systemctl is-enabled gritd)"
  sleep 10
  journal | grep -E "device|SocketCAN" | head -4
  systemctl stop gritd

  say "recordings"
  for recording in $(ls /var/lib/gritd/*.mcap | grep -v '\.[0-9]*\.mcap$'); do timeout 600 gritd replay --verify "$recording" 2>&1 | cat; done

  say "uninstall"
  make -s -C /root/gritd uninstall
  ls /etc/gritd /var/lib/gritd
  ls /etc/systemd/system/gritd.service /opt/gritd
  say "end"
  systemctl poweroff
}

if [ -e /root/second ]; then second_boot; else first_boot; fi
