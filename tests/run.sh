#!/usr/bin/env bash
# Every test: installs what the tests need, then runs formatting, lints, documentation, the Rust tests of all packages (real mpirun among
# them), and the readers of results (VTK, Python, and ParaView where it is installed) on the files of real runs. Ends with one line `N passed, N failed` and status 1 if any failed.
#
#   bash tests/run.sh
#
# Time limits only catch what hangs. SOLVER_TEST_PATIENCE=N, a whole number, multiplies them on slow or busy machines.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
install_needs --tests
use_environment
cd "$root"

target=${CARGO_TARGET_DIR:-$root/target}
# A first build is made once: what makes later builds fast only slows it.
[ -d "$target/debug/incremental" ] || export CARGO_INCREMENTAL=0
# Runs make their files durable one by one. In memory, where there is room, that takes no time even while the disk is busy.
if [ -w /dev/shm ] && [ "$(df --output=avail -k /dev/shm | tail -n 1)" -gt 4000000 ]; then
  memory=$(mktemp -d /dev/shm/solver-tests.XXXXXX)
  export TMPDIR=$memory
fi
# Jobs of the tests run on this machine alone: looking for the hardware of clusters takes most of a start, ranks bound
# to cores would all share the first ones, and one that waits lets another run.
export OMPI_MCA_pml=ob1 OMPI_MCA_btl=self,vader OMPI_MCA_hwloc_base_binding_policy=none
export OMPI_MCA_mpi_yield_when_idle=1 PMIX_MCA_psec=native
# Random inputs are the same in every run; jobs/reliability draws others.
export PROPTEST_RNG_SEED=1
# Unit tests run beside each other and share one pool: with more threads their small loops would wait for each other. Tests of
# threads make their own pools, and the program is told its number.
export RAYON_NUM_THREADS=1
# More tests than cores at once: those that run jobs wait for each other (tests/suite/ranks.rs), and one computes while another starts.
export RUST_TEST_THREADS=$(($(nproc) + 2))
work=$(mktemp -d)
trap 'rm -rf "$work" "${memory:-$work}"' EXIT
passed=0
failed=0
failures=()
begin=$SECONDS

# gate NAME COMMAND...: one test; its output is shown only when it fails.
gate() {
  local name=$1
  shift
  local start=$SECONDS
  if "$@" >"$work/gate.log" 2>&1; then
    passed=$((passed + 1))
    echo "ok      $name ($((SECONDS - start)) s)"
  else
    failed=$((failed + 1))
    failures+=("$name")
    cat "$work/gate.log"
    echo "FAILED  $name"
  fi
}

# The Rust tests, each counted. A part that does not build or is killed is one failure. The limit counts from the first test.
rust_tests() {
  local status=0 ok bad limit=$((2400 * ${SOLVER_TEST_PATIENCE:-1}))
  if ! cargo test --workspace --locked --no-run; then
    failed=$((failed + 1))
    failures+=("cargo test: the tests do not build")
    return
  fi
  timeout --kill-after=30 "$limit" cargo test --workspace --locked --no-fail-fast 2>&1 | tee "$work/rust.log" ||
    status=$?
  if [ "$status" -eq 124 ] || [ "$status" -eq 137 ]; then
    failures+=("cargo test: ended by its limit of $limit s, which SOLVER_TEST_PATIENCE=N multiplies")
  fi
  ok=$(awk '/^test result:/ { sum += $4 } END { print sum + 0 }' "$work/rust.log")
  bad=$(awk '/^test result:/ { sum += $6 } END { print sum + 0 }' "$work/rust.log")
  if [ "$status" -ne 0 ] && [ "$bad" -eq 0 ]; then
    bad=1
  fi
  passed=$((passed + ok))
  failed=$((failed + bad))
  if [ "$bad" -ne 0 ]; then
    failures+=("cargo test ($bad)")
  fi
}

# The environment of Python, made once for a list of packages and kept with the build.
make_venv() {
  local stamp
  stamp=$(cksum <tests/python/requirements.txt)
  if [ "$(cat "$target/venv/stamp" 2>/dev/null)" = "$stamp" ]; then
    return 0
  fi
  rm -rf "$target/venv" &&
    python3 -m venv "$target/venv" &&
    "$target/venv/bin/pip" install -q --disable-pip-version-check -r tests/python/requirements.txt &&
    echo "$stamp" >"$target/venv/stamp"
}

# A small coupled run on two ranks that writes every kind of file.
small_run() {
  "$target/debug/solver" example piping >"$work/piping.json" &&
    timeout --kill-after=10 180 mpirun --oversubscribe -n 2 "$target/debug/solver" "$work/piping.json" \
      --output "$work/run" --set time.end=0.004 --set time.warm_up=null \
      --set output.fluid.every=0.002 --set output.grains='{"every": 0.002}' --set output.contacts='{"every": 0.002}'
}

# A small run of blocks on two ranks.
blocks_run() {
  "$target/debug/solver" example avalanche >"$work/avalanche.json" &&
    timeout --kill-after=10 60 mpirun --oversubscribe -n 2 "$target/debug/solver" "$work/avalanche.json" \
      --output "$work/run/avalanche" --set time.end=0.02 --set output.blocks.every=0.01 \
      --set output.contacts='{"every": 0.01}'
}

# Every file of these runs, through VTK's readers.
readers() {
  local files
  mapfile -t files < <(find "$work/run" -name '*.xmf' -o -name '*.vtkhdf' | sort)
  if [ "${#files[@]}" -eq 0 ]; then
    echo "the run wrote no .xmf and no .vtkhdf"
    return 1
  fi
  timeout 120 "$target/venv/bin/python" tests/read_outputs.py "${files[@]}"
}

scripts() {
  local file
  for file in jobs/*.sh jobs/*/*.sh jobs/*/*.sbatch benches/*.sh benches/*/*.sh tests/*.sh .ci/run; do
    bash -n "$file" || return 1
  done
  # Without leaving caches.
  python3 -c 'import ast, sys
for name in sys.argv[1:]: ast.parse(open(name, encoding="utf-8").read(), name)' \
    jobs/spack/packages/*/package.py jobs/paraview/*.py jobs/python/*.py jobs/python/*/*.py jobs/theory/*.py benches/*.py benches/*/*.py tests/*.py tests/python/*.py
}

# Every example, shortened, through the reader of results; version and notes. The runs of the gates before are read, not made again.
python_reader() {
  mkdir -p "$work/examples" &&
    ln -sfn "$work/run" "$work/examples/piping" && ln -sfn "$work/run/avalanche" "$work/examples/avalanche" &&
    SOLVER="$target/debug/solver" SOLVER_RUNS="$work/examples" MPLBACKEND=Agg MPLCONFIGDIR="$work/matplotlib" PYTHONDONTWRITEBYTECODE=1 \
      timeout "$((300 * ${SOLVER_TEST_PATIENCE:-1}))" "$target/venv/bin/python" -m pytest -q -p no:cacheprovider tests/python
}

# ParaView states, where there is a ParaView.
paraview_states() {
  bash tests/read_states.sh "$work/run" "$work/run/avalanche"
}

# Waits for the network, not for a core: made while the rest is built.
make_venv >"$work/venv.log" 2>&1 &
venv=$!
python_environment() {
  wait "$venv" || {
    cat "$work/venv.log"
    return 1
  }
}

# The installer finds a libclang, whatever its version, and takes no other library for one.
libclang() {
  local folder=$work/libclang name
  mkdir -p "$folder/none" "$folder/cpp"
  touch "$folder/cpp/libclang-cpp.so.14"
  ! holds_libclang "$folder/none" "$folder/cpp" || return 1
  for name in libclang.so libclang.so.1 libclang-14.so.14.0.6 libclang-14.so.1; do
    mkdir -p "$folder/$name"
    touch "$folder/$name/$name"
    holds_libclang "$folder/cpp" "$folder/$name" || return 1
  done
}

gate "scripts parse" scripts
gate "libclang is told from its kin" libclang
gate "study loop" timeout 60 bash tests/study_loop.sh
# By file: `cargo fmt` does not see the modules that a list of models declares.
every_source() {
  git ls-files -z '*.rs' | xargs -0 rustfmt --edition 2024 --check
}
# Beside the lints, on another core.
every_source >"$work/rustfmt.log" 2>&1 &
rustfmt=$!
formatted() {
  wait "$rustfmt" || {
    cat "$work/rustfmt.log"
    return 1
  }
}
gate "cargo clippy" cargo clippy --workspace --all-targets --locked -- -D warnings
gate "rustfmt" formatted
# Licences, duplicates and sources of the dependencies; advisories where the database can be fetched.
if cargo deny --version >/dev/null 2>&1; then
  gate "cargo deny" cargo deny --locked --offline check licenses bans sources
  if timeout 30 cargo deny --locked fetch db >/dev/null 2>&1; then
    gate "cargo deny advisories" cargo deny --locked check advisories
  else
    echo "skipped cargo deny advisories (the database of advisories cannot be reached)"
  fi
else
  echo "skipped cargo deny (not installed; cargo install --locked cargo-deny)"
fi
# With the driver of the lints as its compiler, the documentation reads the metadata that the lints have made of every package.
driver=$(rustc --print sysroot)/bin/clippy-driver
documented() (
  if [ -x "$driver" ]; then
    export RUSTC_WORKSPACE_WRAPPER=$driver CLIPPY_ARGS=-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__
  fi
  RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked
)
gate "cargo doc" documented
rust_tests
gate "python environment" python_environment
gate "small run on 2 ranks" small_run
gate "small run of blocks on 2 ranks" blocks_run
# Beside the other readers: most of the time one core does all of it.
python_reader >"$work/python.log" 2>&1 &
reader=$!
python_reads() {
  wait "$reader" || {
    cat "$work/python.log"
    return 1
  }
}
gate "schema accepts the examples" timeout 60 "$target/venv/bin/python" tests/schema.py "$target/debug/solver"
gate "VTK reads every output" readers
gate "python reader" python_reads
if command -v pvpython >/dev/null; then
  gate "ParaView opens states" paraview_states
fi

echo
if [ "$failed" -ne 0 ]; then
  printf 'failed: %s\n' "${failures[@]}"
fi
echo "took $((SECONDS - begin)) s"
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
