# What the parts share. Sourced with `set -euo pipefail`; runs in namespaces of its own.

fail() { echo "FAILED: $*" >&2; exit 1; }
ok() { echo "ok: $*"; }

# What the package manager needs of a root folder.
mount_root() { # ROOT
    mount -t proc proc "$1/proc"
    mount --rbind /dev "$1/dev"
    mount -t tmpfs tmpfs "$1/tmp"
    cp /etc/resolv.conf "$1/etc/resolv.conf"
    printf '#!/bin/sh\nexit 101\n' > "$1/usr/sbin/policy-rc.d" && chmod 755 "$1/usr/sbin/policy-rc.d"
}

apt_in() { # ROOT ARGUMENT...
    chroot "$1" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 apt-get -y -qq -o Dpkg::Use-Pty=0 -o Dpkg::Options::=--force-confold \
        --no-install-recommends "${@:2}" > "$work/apt.log" 2>&1 || { cat "$work/apt.log" >&2; fail "apt-get ${*:2}"; }
}

# The same package with a later number: what an upgrade is.
later_package() { # PACKAGE RESULT
    dpkg-deb -R "$1" "$work/later"
    sed -i 's/^Version: .*/&+later/' "$work/later/DEBIAN/control"
    dpkg-deb -Znone --root-owner-group -b "$work/later" "$2" > /dev/null
    rm -rf "$work/later"
}

# Files whose name says whose they were, but for the pages that man keeps of what it has shown.
left_over() { # ROOT
    find "$1" -xdev -name '*gonio*' -not -path "$1/proc/*" -not -path "$1/var/cache/man/*"
}

# Waits for "listening on http://HOST:PORT" in a file and prints the port.
port_in() { # FILE
    for _ in $(seq 600); do
        grep -oP '^listening on http://[^ ]*:\K\d+$' "$1" && return
        sleep 0.1
    done
    fail "no \"listening on\" in $1: $(cat "$1")"
}
