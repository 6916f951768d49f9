#!/bin/bash
# The package in a fresh Debian: lintian, installation, use, upgrade, removal. Started by tests/packaging/run.
set -euo pipefail
root=$1 package=$2
here=$source/tests/packaging
. "$here/common.sh"

lintian --no-cfg --fail-on error "$package" || fail "lintian"
ok "lintian has no error"

mount_root "$root"
apt_in "$root" update
[ -z "$(left_over "$root")" ] || fail "a fresh root has files of gonio"
cp "$package" "$root/tmp/package.deb"
apt_in "$root" install /tmp/package.deb
ok "installed; depends on: $(dpkg-deb -f "$package" Depends)"

chroot "$root" gonio --version | grep -q '^gonio [0-9]' || fail "gonio --version"
chroot "$root" gonio run /usr/share/doc/gonio/clients/examples/wool_albedo_map.json -o /tmp --quiet
[ -s "$root/tmp/wool_albedo_map.csv" ] || fail "gonio run wrote no table"
ok "gonio runs an example of its documentation"

man -l "$root/usr/share/man/man1/gonio-serve.1.gz" | grep -q token || fail "manual page"
# shellcheck disable=SC2016  # for the bash in there
completed=$(chroot "$root" bash -c '. /usr/share/bash-completion/completions/gonio
    COMP_WORDS=(gonio run --no-s) COMP_CWORD=2; _gonio gonio; echo "${COMPREPLY[*]}"')
[ "$completed" = --no-skip ] || fail "completion gives \"$completed\""
ok "manual page and completion"

[ "$(stat -c '%a %U' "$root/etc/gonio/tokens")" = "600 root" ] || fail "tokens: $(stat -c '%a %U' "$root/etc/gonio/tokens")"
[ ! -e "$root/etc/systemd/system/multi-user.target.wants/gonio.service" ] || fail "the service is enabled without being asked"
install -d -m 700 -o 65534 -g 65534 "$root/var/lib/gonio"
serve() {
    # In the background of this shell, so that $! is the program.
    chroot --userspec=65534:65534 "$root" gonio serve --data /var/lib/gonio --listen 127.0.0.1:0 > "$work/serve.out" &
    port=$(port_in "$work/serve.out")
}
serve
job=$("$here/job_check.py" "http://127.0.0.1:$port")
kill -TERM $! && wait $! || fail "serve ended with $?"
ok "serves as an unprivileged user, and ends on SIGTERM"

echo '# a change of the administrator' >> "$root/etc/gonio/serve.conf"
tokens=$(cat "$root/etc/gonio/tokens")
later_package "$package" "$root/tmp/later.deb"
apt_in "$root" install /tmp/later.deb
chroot "$root" dpkg-query -W -f '${Version}' gonio | grep -q later || fail "no upgrade"
grep -q 'a change of the administrator' "$root/etc/gonio/serve.conf" || fail "the upgrade overwrote serve.conf"
[ "$tokens" = "$(cat "$root/etc/gonio/tokens")" ] || fail "the upgrade changed the tokens"
serve
"$here/job_check.py" "http://127.0.0.1:$port" --again "$job" > /dev/null
kill -TERM $! && wait $! || fail "serve ended with $?"
ok "an upgrade keeps jobs, tokens and configuration"

apt_in "$root" remove gonio
[ -e "$root/etc/gonio/tokens" ] && [ -e "$root/var/lib/gonio/jobs.db" ] || fail "removal took configuration or data"
apt_in "$root" purge gonio
[ -z "$(left_over "$root")" ] || fail "purge leaves $(left_over "$root")"
ok "removal keeps data, purge leaves nothing"
