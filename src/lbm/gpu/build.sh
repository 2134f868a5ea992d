#!/bin/bash
# Compiles the kernels of `src/lbm/kernels.rs` to PTX for NVIDIA GPUs of compute capability 8.0 and above, into the archive
# `kernels.ptx.gz` in the folder of this script.
#
#   bash src/lbm/gpu/build.sh
#
# There is no precompiled core library for this target, so that the script compiles it from source: `jobs/install.sh --kernels` installs
# Debian's packages rustc-web and rust-web-src; the variables RUSTC and CORE select another compiler and source. The first lines of each text
# in the archive name the compiler, the sources and their hash, which a test compares with the sources.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/.." # src/lbm
rustc=${RUSTC:-/usr/bin/rustc}
core=${CORE:-/usr/lib/rustlib/src/rust/library/core/src/lib.rs}
[ -f "$core" ] || { echo "build.sh: no source of the core library at $core; run jobs/install.sh --kernels" >&2; exit 1; }
built=${CARGO_TARGET_DIR:-../../target}/ptx
mkdir -p "$built"
export RUSTC_BOOTSTRAP=1 # the core library and the kernels use unstable parts of this very compiler
flags=(--target nvptx64-nvidia-cuda --edition 2024 -C opt-level=3 -C panic=abort -C target-cpu=sm_80 -L "$built")
"$rustc" "${flags[@]}" --crate-type rlib --crate-name core -Zforce-unstable-if-unmarked -A warnings --emit=link="$built/libcore.rlib" "$core"
"$rustc" "${flags[@]}" --crate-type rlib --crate-name compiler_builtins -Zforce-unstable-if-unmarked -A warnings \
  --emit=link="$built/libcompiler_builtins.rlib" - <<< '#![feature(compiler_builtins)] #![compiler_builtins] #![no_std]'
for kernels in bgk trt mrt covers_mrt_d3q27 covers_trt_d3q27 balls checks copies; do
  "$rustc" "${flags[@]}" --crate-type lib --crate-name gpu --cfg "kernels=\"$kernels\"" \
    --emit=asm="$built/$kernels.ptx",dep-info="$built/$kernels.d" kernels.rs
  sources=$(sed -n 's/^\(.*\.rs\):$/\1/p' "$built/$kernels.d" | sort)
  {
    echo "// Kernels: $kernels"
    echo "// Made by src/lbm/gpu/build.sh with $("$rustc" --version)."
    echo "// Sources in src/lbm:" $sources
    echo "// Hash of the sources, one after the other: $(cat $sources | sha256sum | cut -d ' ' -f 1)"
    cat "$built/$kernels.ptx"
  }
done | gzip -9 --no-name > "$here/kernels.ptx.gz"
