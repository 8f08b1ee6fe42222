#!/bin/sh
# bounded_waits.sh BINARY...: each lets the threads of OpenMP spin for a short time only, unless its
# user chose otherwise, and still gets its arguments (experiments/bounded_waits.cpp).
unset OMP_WAIT_POLICY GOMP_SPINCOUNT

# spins BINARY: what libgomp read of its environment
spins() {
  OMP_DISPLAY_ENV=verbose "$1" --help 2>&1 >/dev/null | sed -n "s/.*GOMP_SPINCOUNT = '\(.*\)'.*/\1/p"
}
fail() {
  echo "$binary: expected $1, found $2"
  exit 1
}
for binary; do
  found=$(spins "$binary")
  [ "$found" = 20000 ] || fail "20000 spins" "$found"
  found=$(GOMP_SPINCOUNT=7 spins "$binary")
  [ "$found" = 7 ] || fail "the 7 spins of its user" "$found"
  found=$(OMP_WAIT_POLICY=active spins "$binary")
  [ "$found" -gt 1000000 ] || fail "the active waiting of its user" "$found"
  found=$("$binary" "/a folder/none.yaml" 2>&1 >/dev/null)
  code=$?
  [ "$code" = 1 ] || fail "exit code 1 without a configuration" "$code"
  case $found in
    *"/a folder/none.yaml"*) ;;
    *) fail "a message that names /a folder/none.yaml" "$found" ;;
  esac
done
echo "$# binaries spin for a short time"
