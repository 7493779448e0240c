#!/bin/sh
# Runs an image in QEMU, its log decoded: cargo run --release. Ctrl-C ends it. The link is on TCP port 4050:
# host-sim link --port tcp:127.0.0.1:4050 status
set -eu
for tool in qemu-system-arm defmt-print; do
    command -v "$tool" >/dev/null || { echo "$tool is missing: run 'cargo xtask setup' in the project's root" >&2; exit 1; }
done
qemu-system-arm -M olimex-stm32-h405 -nographic -monitor none -serial null \
    -serial tcp:127.0.0.1:4050,server=on,wait=off,nodelay=on \
    -semihosting-config enable=on,target=native -kernel "$1" | defmt-print -e "$1"
