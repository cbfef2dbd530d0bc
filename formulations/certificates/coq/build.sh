#!/bin/sh
# Compiles and proves everything, prints the axioms, extracts the checker and builds the program
# cocap-check-verified: build.sh [FOLDER], where all of this goes (build, beside this file).
# Needs Coq 8.16, OCaml 4.13, ocamlfind and zarith.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
folder=${1:-$here/build}
mkdir -p "$folder"
cp "$here"/*.v "$here"/*.ml "$folder"
cd "$folder"
for module in Spec Sums Returns Prices Worth Rows Sweep Checker Gains Tangents Pools Search Narrowing Joints Steps Moves Staged Paths Build Extract; do
    coqc -q -R . CocapCheck "$module.v"
done
ocamlfind ocamlopt -w -a -inline 200 -package unix,zarith -linkpkg checker.mli checker.ml \
    instance_lines.ml advice.ml driver.ml -o cocap-check-verified
