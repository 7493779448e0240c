#!/bin/sh
# Runs an image in QEMU, its log decoded: cargo run --release, and cargo xtask board. Ctrl-C ends it. The link is on TCP port 4050, or on
# LINK_PORT: springpot link --port tcp:127.0.0.1:4050 status
#
# qemu.args holds what springpot passes as well. "-icount shift=0" lets a nanosecond pass on the chip per instruction: a tick
# takes the same time on a busy machine. USART1 is not connected, USART2 is the link.
set -eu
for tool in qemu-system-arm defmt-print; do
    command -v "$tool" >/dev/null || { echo "$tool is missing: run 'cargo xtask setup' in the project's root" >&2; exit 1; }
done
# shellcheck disable=SC2046 # the arguments hold no spaces
qemu-system-arm $(cat "$(dirname "$0")/qemu.args") -serial tcp:127.0.0.1:"${LINK_PORT:-4050}",server=on,wait=off,nodelay=on \
    -kernel "$1" | defmt-print -e "$1"
