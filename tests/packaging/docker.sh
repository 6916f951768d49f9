#!/bin/bash
# The image, built by buildah upon a Debian made here, and the service in it. Started by tests/packaging/run.
set -euo pipefail
root=$1
here=$source/tests/packaging
. "$here/common.sh"
export STORAGE_DRIVER=vfs BUILDAH_ISOLATION=chroot
buildah() { command buildah --root "$work/storage" --runroot "$work/storage-run" "$@"; }

base=$(buildah from scratch)
buildah add -q "$base" "$root" / > /dev/null
buildah commit -q "$base" localhost/debian > /dev/null
cd "$source"
buildah bud --format docker --build-arg BASE=localhost/debian -f deploy/docker/Dockerfile -t gonio . > "$work/bud.log" 2>&1 \
    || { tail -50 "$work/bud.log" >&2; fail "build"; }
ok "built; $(du -sm "$(buildah mount "$(buildah from gonio)")" | cut -f1) MiB"

container=$(buildah from gonio)
buildah config --volume /var/lib/gonio- "$container"  # buildah would throw away what is written there
image=$(buildah mount "$container")
[ ! -e "$image/etc/gonio/tokens" ] || fail "the image carries a token"
[ -z "$(find "$image/usr/bin" -name 'g++*' -o -name cmake)" ] || fail "the image carries the compiler"
[ "$(stat -c %u "$image/var/lib/gonio")" = 10001 ] || fail "the data folder is not the user's"

# What the image says it runs, line by line.
configured() { # MEMBER
    buildah inspect --type image gonio | /usr/bin/python3 -c "import json, sys
for word in json.load(sys.stdin)['Docker']['config'].get('$1') or []: print(word)"
}
mapfile -t command < <(configured Entrypoint; configured Cmd)
mapfile -t health < <(buildah inspect --type image gonio | /usr/bin/python3 -c "import json, sys
print('\n'.join(json.load(sys.stdin)['Docker']['config']['Healthcheck']['Test'][1:]))")
[ "$(buildah inspect --type image --format '{{.Docker.Config.User}}' gonio)" = 10001:10001 ] || fail "not its own user"
token=0123456789abcdef0123
echo "test $token" > "$work/tokens"
chown 10001 "$work/tokens"
chmod 400 "$work/tokens"
install -d -m 700 -o 10001 -g 10001 "$work/data"  # the volume, which outlives a container

# A loopback interface of its own, so that port 8080 is free.
export -f buildah ok fail
export container image token work here
unshare --net bash -euc '
    ip link set lo up
    health=("${@:2:$1}") && shift $(($1 + 1))
    in_image() { buildah run --volume "$work/tokens:/run/secrets/tokens:ro" --volume "$work/data:/var/lib/gonio" "$container" -- "$@"; }
    if in_image "${health[@]}" 2> /dev/null; then fail "healthy before it runs"; fi
    in_image "$@" > "$work/out" 2>&1 &
    "$here/job_check.py" http://127.0.0.1:8080 --token "$token" --wait 120 > "$work/job" || fail "$(cat "$work/out")"
    in_image "${health[@]}" || fail "unhealthy"
    user=$(stat -c %u /proc/$(pgrep -x gonio))
    [ "$user" = 10001 ] || fail "runs as $user"
    kill -TERM $(pgrep -x gonio) && wait $!
    ok "runs a job as user $user, healthy, ends on SIGTERM"
    # As PID 1, which a container gives it, a signal without a handler would be ignored.
    mkdir -p "$image/run/secrets" && cp -p "$work/tokens" "$image/run/secrets/"
    mount --bind "$work/data" "$image/var/lib/gonio"
    unshare --pid --fork --mount-proc chroot --userspec=10001:10001 "$image" "$@" > "$work/out" &
    "$here/job_check.py" http://127.0.0.1:8080 --token "$token" --again "$(cat "$work/job")" > /dev/null
    kill -TERM $(pgrep -x gonio) && wait $!
    ok "ends on SIGTERM as PID 1, too; the job of before was there"
' docker "${#health[@]}" "${health[@]}" "${command[@]}"
