#!/bin/bash
# The unit under a systemd that is PID 1 of a fresh Debian in namespaces. Started by tests/packaging/run.
set -euo pipefail
root=$1 package=$2
here=$source/tests/packaging
. "$here/common.sh"

# Everything that systemd wants to see at its start; no network but a loopback interface of its own.
boot() {
    unshare --mount --pid --fork --uts --ipc --net --cgroup --kill-child bash -euc '
        mount --make-rprivate /
        mount --bind "$1" "$1" && cd "$1"
        mount -t proc proc proc
        mount -t sysfs -o ro sysfs sys
        mount -t tmpfs cgroups sys/fs/cgroup && mount -t cgroup2 cgroup2 sys/fs/cgroup
        mount -t tmpfs run run && mount -t tmpfs dev dev
        for device in null zero full random urandom tty; do touch dev/$device && mount --bind /dev/$device dev/$device; done
        mkdir dev/pts dev/shm old && ln -s pts/ptmx dev/ptmx
        mount -t devpts -o newinstance,ptmxmode=0666 devpts dev/pts && mount -t tmpfs shm dev/shm
        pivot_root . old && umount -l /old && rmdir /old
        mount --make-rshared /  # in a container systemd leaves this to who starts it; credentials need it
        container=other exec /lib/systemd/systemd --system --unit=multi-user.target' boot "$root" > "$work/boot.log" 2>&1 &
    local starter=$!
    for _ in $(seq 600); do
        init=$(pgrep -P $starter || true)
        [ -n "$init" ] && inside systemctl is-system-running > "$work/state" 2> /dev/null && return
        sleep 0.1
    done
    fail "systemd does not come up ($(cat "$work/state")): $(cat "$work/boot.log")"
}
inside() { nsenter --target "$init" --all "$@"; }
check_job() {
    nsenter --target "$init" --net "$here/job_check.py" http://127.0.0.1:8080 --token "$token" "$@" \
        || { inside journalctl -u gonio --no-pager >&2; fail "job_check.py $*"; }
}
service_property() { inside systemctl show --value -p "$1" gonio.service; }
install_inside() { # PACKAGE, without a network: what it depends on is there
    cp "$1" "$root/root/package.deb"
    inside env DEBIAN_FRONTEND=noninteractive dpkg --force-confold -i /root/package.deb > "$work/dpkg.log" 2>&1 || fail "$(cat "$work/dpkg.log")"
}

# What it depends on comes over the network of this machine; the package itself under systemd.
(
    mount_root "$root"
    apt_in "$root" update
    cp "$package" "$root/tmp/package.deb"
    apt_in "$root" install /tmp/package.deb man-db
    apt_in "$root" purge gonio
)
umount -l "$root/tmp" "$root/dev" "$root/proc"
rm "$root/usr/sbin/policy-rc.d"
boot
ok "systemd $(inside systemctl --version | head -1 | cut -d' ' -f2) is PID 1: $(cat "$work/state")"
install_inside "$package"
complaints=$(inside systemd-analyze verify gonio.service 2>&1) || fail "systemd-analyze verify: $complaints"
[ -z "$complaints" ] || fail "systemd-analyze verify: $complaints"
exposure=$(inside systemd-analyze security --no-pager gonio.service | grep -oP 'Overall exposure level for gonio.service: \K[0-9.]+')
awk -v exposure="$exposure" 'BEGIN { exit !(exposure <= 1.5) }' || fail "exposure $exposure"
ok "systemd-analyze verify is silent, security says $exposure"

[ "$(service_property ActiveState)" = inactive ] || fail "installation started the service"
token=$(awk '$1 == "local" { print $2 }' "$root/etc/gonio/tokens")
inside systemctl enable --now --quiet gonio.service || fail "start: $(inside journalctl -u gonio --no-pager)"
job=$(check_job)
main=$(service_property MainPID)
user=$(inside stat -c %u "/proc/$main")
[ "$user" != 0 ] || fail "runs as root"
[ -e "$root/var/lib/private/gonio/jobs.db" ] || fail "no jobs.db in the state folder"
status=$(nsenter --target "$init" --net /usr/bin/python3 -c 'import urllib.request, urllib.error
try: urllib.request.urlopen("http://127.0.0.1:8080/jobs")
except urllib.error.HTTPError as error: print(error.code)')
[ "$status" = 401 ] || fail "without a token: $status"
inside journalctl -u gonio --no-pager | grep -q 'listening on http' || fail "the journal does not say where it listens"
ok "runs a job behind every wall of the unit, as user $user"

inside systemctl kill --kill-whom=main --signal=KILL gonio.service
check_job --again "$job" > /dev/null
[ "$(service_property NRestarts)" = 1 ] || fail "NRestarts is $(service_property NRestarts)"
ok "comes back after kill -9, with its jobs"

later_package "$package" "$work/later.deb"
main=$(service_property MainPID)
install_inside "$work/later.deb"
check_job --again "$job" > /dev/null
[ "$(service_property MainPID)" != "$main" ] || fail "the upgrade left the old program running"
ok "an upgrade restarts it, with its jobs"

inside systemctl stop gonio.service
[ "$(service_property Result)" = success ] || fail "stop: $(service_property Result)"
inside systemctl start gonio.service
check_job > /dev/null
ok "stops on SIGTERM and starts again"

inside dpkg --purge gonio > "$work/dpkg.log" 2>&1 || fail "$(cat "$work/dpkg.log")"
[ "$(service_property LoadState)" = not-found ] || fail "the unit is still known"
inside bash -c "grep -qsx gonio /proc/[0-9]*/comm" && fail "gonio still runs"
rm -rf "$root/root/package.deb"
[ -z "$(left_over "$root")" ] || fail "purge leaves $(left_over "$root")"
ok "purge stops it and leaves nothing"
