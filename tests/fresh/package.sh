# docs/service.md: the package that the step deb made, installed, upgraded, removed and purged. systemd does not run here.
. /root/gritd/tests/fresh/common.sh
one=$(echo /root/*gritd_*.deb)
two=/tmp/two.deb

same() { [ "$1" = "$2" ] || { echo "found $1; expected $2" >&2; exit 1; }; }
config() { sed -n 's/^testbed: //p' /etc/gritd/config.yaml; }

printf '#!/bin/sh\nexit 101\n' >/usr/sbin/policy-rc.d
chmod +x /usr/sbin/policy-rc.d

timed "apt install" packages "$one"
id gritd
gritd check-config /etc/gritd/config.yaml >/dev/null
systemd-analyze verify /usr/lib/systemd/system/gritd.service /usr/lib/systemd/system/gritd-view.service
cd /tmp
timed "gritd demo --seconds 20" sh -c 'gritd demo --seconds 20 >/tmp/demo.log 2>&1'
tail -n 3 /tmp/demo.log

# A newer version with another configuration: the user's own stays, and so do recordings.
install -d -o gritd -g gritd -m 750 /var/lib/gritd
cp /tmp/runs/*/*.mcap /var/lib/gritd/
sed -i 's/^testbed: .*/testbed: mine/' /etc/gritd/config.yaml
dpkg-deb --raw-extract "$one" /tmp/two
echo '# of the newer version' >>/tmp/two/etc/gritd/config.yaml
sed -i 's/^Version: .*/Version: 999-1/' /tmp/two/DEBIAN/control
dpkg-deb -Zgzip -z1 --root-owner-group --build /tmp/two "$two" >/dev/null
timed "upgrade" packages -o Dpkg::Options::=--force-confold "$two"
same "$(dpkg-query --show --showformat '${Version} ${Status}' gritd)" "999-1 install ok installed"
same "$(config)" mine
gritd --version

# Removed: the configuration and the recordings stay; installed again, they are found.
timed "apt remove" sh -c 'apt-get remove -y -qq gritd >/dev/null'
same "$(ls -d /usr/lib/gritd /usr/bin/gritd /usr/lib/systemd/system/gritd.service 2>/dev/null)" ""
same "$(config)" mine
ls /var/lib/gritd/*.mcap
timed "install again" packages "$two"
same "$(config)" mine

# Purged: the recordings alone stay.
apt-get purge -y -qq gritd >/dev/null
same "$(find / -xdev -path /root -prune -o -path /tmp -prune -o -name '*gritd*' -print)" /var/lib/gritd
ls /var/lib/gritd/*.mcap
