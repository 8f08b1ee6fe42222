#!/usr/bin/env bash
# Holds the direction of includes. The layers are listed below, lowest first: a file may include
# headers of its own layer and of lower ones, never of a higher one. A file belongs to the first
# line that is a prefix of its path. Beyond that:
#   - ops/kernels and the folders of uniphy that are built without torch include no torch;
#   - only uniphy/config reads YAML;
#   - ops/reference, which tests and the bench compare with, is included by nobody else;
#   - experiments, the mains, are included by nobody at all.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

git grep -n '^ *# *include *[<"]' -- '*.hpp' '*.cpp' '*.h' | awk -F: '
  BEGIN {
    count = split("ops/kernels/ ops/ models/ uniphy/io/ uniphy/config/ uniphy/report/ " \
                  "uniphy/geometry/ uniphy/scene/ uniphy/data/ uniphy/training/ " \
                  "uniphy/inference/ uniphy/stability/ uniphy/evaluation/ uniphy/identify/ uniphy/bench/ " \
                  "experiments/ tests/", layer, " ")
    torch_free = "^(ops/kernels|uniphy/(io|config|report|geometry|scene|data))/"
  }
  function layer_of(path,    i) {
    for (i = 1; i <= count; ++i) if (index(path, layer[i]) == 1) return i
    return 0
  }
  function offends(why) {
    print "includes: " $0 "\n  " why
    failed = 1
  }
  {
    from = $1
    header = $0
    sub(/^[^"<]*["<]/, "", header)
    sub(/[">].*$/, "", header)
    mine = layer_of(from)
    theirs = layer_of(header)
    ++seen
    if (!mine) offends(from " is in no layer of .ci/includes.sh")
    else if (header ~ /^(torch|ATen|c10)\// && from ~ torch_free)
      offends("is built without torch")
    else if (header ~ /^yaml-cpp\// && from !~ /^uniphy\/config\//)
      offends("only uniphy/config reads YAML")
    else if (header ~ /^experiments\//)
      offends("a main is included from nowhere")
    else if (theirs > mine) offends(layer[mine] " knows nothing of " layer[theirs])
    else if (from ~ torch_free && header ~ /^(ops|models)\// && header !~ /^ops\/kernels\//)
      offends("is built without torch, which " layer[theirs] " needs")
    else if (header ~ /^ops\/reference\// && from !~ /^(ops\/reference|uniphy\/bench|tests)\//)
      offends("ops/reference is for tests and the bench")
  }
  END {
    if (!failed) print "includes: " seen " lines keep to the layers"
    exit failed
  }'
