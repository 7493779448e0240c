#!/bin/sh
# Debian's compiler. Unstable features are for the crates of its own library alone, which cargo marks so; RUSTC_BOOTSTRAP allows the options
# of the others that cargo needs, but no feature.
case "$*" in
*force-unstable-if-unmarked*) ;;
*) set -- -Z allow-features= "$@" ;;
esac
exec "${DEBIANS_RUSTC:-/usr/bin/rustc}" "$@"
