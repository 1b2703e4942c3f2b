#!/bin/sh
# Installs a package in a fresh root, runs it, upgrades it, removes it, purges it: sh release/debian/trial.sh FILE.deb
# Before each step it says what it expects; the first thing that is otherwise ends it.
set -eu
export DEBIAN_FRONTEND=noninteractive
began=$(date +%s)
after() { echo "   $(( $(date +%s) - began )) s: $*"; }

demo() {
    # The demo is ready, answers with a position, and ends when it is asked to.
    mount-gateway demo --port 0 --pty /tmp/lx200 >/tmp/said 2>&1 &
    demo=$!
    for _ in $(seq 100); do grep -q '^ready lx200' /tmp/said && break; sleep 0.2; done
    port=$(sed -n 's/^ready lx200.*tcp:.*:\([0-9]*\).*/\1/p' /tmp/said | head -n 1)
    answer=$(bash -c "exec 3<>/dev/tcp/127.0.0.1/$port; printf ':GR#' >&3; head -c 9 <&3")
    case $answer in [0-2][0-9]:[0-5][0-9]:[0-5][0-9]\#) ;; *) echo "the demo answered '$answer'"; cat /tmp/said; exit 1 ;; esac
    kill -INT $demo
    wait $demo
}

apt-get update -qq
apt-get install -y -qq "$1" >/dev/null
after "installed: $(mount-gateway --version)"
demo
after "the demo runs"
[ -n "$(find /opt/mount-gateway -name '*.pyc' | head -n 1)" ] || { echo "nothing is compiled"; exit 1; }
id mount-gateway | grep -q dialout
runuser -u mount-gateway -- mount-gateway doctor --help >/dev/null

apt-get install -y -qq --no-install-recommends systemd udev >/dev/null
touch /etc/mount-gateway/pier.toml
systemd-analyze verify /usr/lib/systemd/system/mount-gateway@.service 2>&1 | grep -i mount-gateway && exit 1
if udevadm verify --help >/dev/null 2>&1; then udevadm verify /usr/lib/udev/rules.d/60-mount-gateway.rules >/dev/null; fi
systemctl enable --quiet mount-gateway@pier
[ -n "$(ls /etc/systemd/system/multi-user.target.wants/mount-gateway@pier.service)" ]
after "unit and rule are accepted, a gateway is enabled"

mkdir -p /var/lib/mount-gateway/pier /var/cache/mount-gateway
echo kept >/var/lib/mount-gateway/pier/state
dpkg-deb -R "$1" /tmp/next
sed -i 's/^Version: .*/Version: 999.0-1/' /tmp/next/DEBIAN/control
dpkg-deb -Znone -b /tmp/next /tmp/next.deb >/dev/null
apt-get install -y -qq /tmp/next.deb >/dev/null
demo
grep -q kept /var/lib/mount-gateway/pier/state
after "upgraded, the state is kept"
apt-get install -y -qq --allow-downgrades "$1" >/dev/null
demo
grep -q kept /var/lib/mount-gateway/pier/state
after "and back"

apt-get remove -y -qq mount-gateway >/dev/null
[ ! -e /opt/mount-gateway ] && [ ! -e /usr/bin/mount-gateway ] || { find /opt/mount-gateway | head; exit 1; }
[ -e /var/lib/mount-gateway/pier/state ] && [ -e /etc/mount-gateway/pier.toml ]
after "removed, state and configuration are kept"
apt-get purge -y -qq mount-gateway >/dev/null
# The user's own state, in /root, is nobody's to delete.
left=$(find / \( -path /proc -o -path /dev -o -path /src -o -path /shared -o -path /root -o -path /tmp -o -path /var/cache/apt \) \
    -prune -o -name '*mount-gateway*' -print)
[ -z "$left" ] && ! getent passwd mount-gateway || { echo "left behind: $left"; exit 1; }
after "purged: nothing is left"
