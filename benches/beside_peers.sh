#!/usr/bin/env bash
# The benches of record: the solver and its peers by turns on the same cores in the same minutes, ratios against the bars.
#
#   bash benches/beside_peers.sh [OPTIONS] [P-1 … P-14]     all fourteen without a name
#
#   --pairs N      runs of each; default 3, which is the least of a record
#   --build        build solver and benches first (cargo, some minutes); else what is under target/release is used
#   --install      install the peers first (benches/peers/install.sh)
#   --busy-ok      measure although other processes load the machine; the results say so
#   --avx2         solver and lbmpy with vectors of four numbers, also where the processor has longer ones; results go to
#                  benches/results/avx2
#   --quick        tiny sizes to try the script; results go to target/peers/quick, not to benches/results
#   --results DIR  where the results go
#
# Writes P-1.csv … and summary.svg; benches/README.md says what each row means and how to read it. Environment: SOLVER,
# BLOCKS_BENCH, DEM_BENCH, DARCY_BENCH (binaries), PEERS_VENV (a Python environment with lbmpy and FiPy), CORES (default 0,1: the first
# alone for rows of one core). waLBerla is in no distribution: WALBERLA_GRAVITY_WAVE, WALBERLA_GRAVITY_WAVE_3D (P-14) and
# WALBERLA_FLUIDIZED_BED (P-6) name its binaries as benches/peers/walberla.py describes them; without them these lines are left out.
#
# Ends with 0 when every row was measured, whether or not it meets its bar; 1 when one could not be.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/.." && pwd)
# shellcheck source=benches/peers/install.sh
. "$here/peers/install.sh"
command_line="bash benches/beside_peers.sh $*"

usage() {
  sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2
  exit 2
}

pairs=3
build=0
install=0
busy_ok=0
quick=0
avx2=0
results=
rows=()
while [ $# -gt 0 ]; do
  case $1 in
    --pairs | --results)
      [ $# -ge 2 ] || usage
      if [ "$1" = --pairs ]; then pairs=$2; else results=$2; fi
      shift
      ;;
    --build) build=1 ;;
    --install) install=1 ;;
    --busy-ok) busy_ok=1 ;;
    --avx2) avx2=1 ;;
    --quick) quick=1 ;;
    P-[1-9] | P-1[0-4]) rows+=("$1") ;;
    *) usage ;;
  esac
  shift
done
[ "${#rows[@]}" -gt 0 ] || rows=(P-1 P-2 P-3 P-4 P-5 P-6 P-7 P-8 P-9 P-10 P-11 P-12 P-13 P-14)
case $pairs in
  '' | *[!0-9]* | 0) usage ;;
esac
if [ "$pairs" -lt 3 ] && [ "$quick" -eq 0 ]; then
  echo "beside_peers: a record needs 3 pairs; use --quick to try the script" >&2
  exit 2
fi

target=${CARGO_TARGET_DIR:-$root/target}
folder=$(peers_folder)
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
if [ -z "$results" ]; then
  if [ "$quick" -eq 1 ]; then results=$folder/quick; else results=$here/results; fi
  [ "$avx2" -eq 0 ] || results=$results/avx2
fi
mkdir -p "$results"
work=$(mktemp -d "$folder/work.XXXXXX")
trap 'rm -rf "$work"' EXIT
cores=${CORES:-0,1}
core=${cores%%,*}
use_environment
lbmpy_vectors=longest
[ "$avx2" -eq 0 ] || export SOLVER_LANES=avx2 lbmpy_vectors=avx2
export OMP_NUM_THREADS=1 RAYON_NUM_THREADS=1 FIPY_SOLVERS=scipy

if [ "$install" -eq 1 ]; then
  install_peers "${rows[@]}"
fi
if [ "$build" -eq 1 ]; then
  check_rust
  (cd "$root" && cargo build --release --locked --bin solver && cargo bench --locked --no-run --bench blocks --bench dem --bench darcy)
fi
solver=${SOLVER:-$target/release/solver}

# The newest binary of a bench; the hash in its name changes with what it is built from.
bench_binary() {
  local given=$1 name=$2 file newest=
  if [ -n "$given" ]; then
    echo "$given"
    return
  fi
  for file in "$target/release/deps/$name"-*; do
    if [ -x "$file" ] && [ -f "$file" ] && { [ -z "$newest" ] || [ "$file" -nt "$newest" ]; }; then
      newest=$file
    fi
  done
  if [ -z "$newest" ]; then
    echo "beside_peers: the bench $name is not built; call with --build, or: cargo bench --no-run --bench $name" >&2
    return 1
  fi
  echo "$newest"
}

need_solver() {
  if [ ! -x "$solver" ]; then
    echo "beside_peers: no $solver; call with --build, or: cargo build --release" >&2
    return 1
  fi
}

# Share of the time in which the processors had nothing to do, over two seconds.
idle_share() {
  local a b
  a=$(head -n 1 /proc/stat)
  sleep 2
  b=$(head -n 1 /proc/stat)
  awk -v a="$a" -v b="$b" 'BEGIN {
    n = split(a, x, " "); split(b, y, " ");
    for (k = 2; k <= n && k <= 9; k++) all += y[k] - x[k];
    idle = y[5] - x[5] + y[6] - x[6];
    printf "%.3f\n", (all > 0) ? idle / all : 1 }'
}

# Waits for an idle machine, refuses after a minute, and notes the idle share for the header.
quiet() {
  local idle try
  for ((try = 1; try <= 15; try++)); do
    idle=$(idle_share)
    if awk -v i="$idle" 'BEGIN { exit !(i >= 0.95) }'; then
      echo "$idle" >>"$work/idle"
      return 0
    fi
    [ "$busy_ok" -eq 0 ] || break
    sleep 2
  done
  if [ "$busy_ok" -eq 0 ]; then
    echo "beside_peers: the machine is busy (only $idle of its time was idle over 2 s, and no more for a minute): end the other work, or measure all the same with --busy-ok" >&2
    return 1
  fi
  echo "$idle" >>"$work/idle"
  : >"$work/busy"
}

# field KEY[.INDEX] <JSON: a value of the last line or of the whole text.
field() {
  python3 -c '
import json, sys
text = sys.stdin.read().strip()
try:
    value = json.loads(text)
except ValueError:
    lines = [line[line.index("{"):] for line in text.splitlines() if "{" in line]
    if not lines:
        sys.exit("beside_peers: no result in: " + text[-300:])
    value = json.loads(lines[-1])
for key in sys.argv[1].split("."):
    value = value[int(key)] if key.isdigit() else value[key]
print(value)' "$1"
}

# record ROW QUANTITY UNIT OURS PEER NAME SENSE BAR AIM: one pair. SENSE: rate (more is better), time, or limit (ours over
# peer is to stay below the bar).
record() {
  local row=$1
  shift
  (IFS=$'\t' && echo "$*") >>"$work/$row.tsv"
  echo "  $row $1: ours $3, $5 $4 ($2)"
}

# by_turns PAIR OURS PEER...: calls the functions, ours first in odd pairs and last in even ones.
# They set variables of the caller, so that no name here may be one of theirs.
by_turns() {
  local turn=$1 first=$2 other
  shift 2
  quiet
  if [ $((turn % 2)) -eq 1 ]; then "$first"; fi
  for other in "$@"; do "$other"; done
  if [ $((turn % 2)) -eq 0 ]; then "$first"; fi
}

limited() { timeout --kill-after=30 1800 "$@"; }

# run_solver NAME RANKS THREADS CASE [ARGS...]: a run pinned to as many cores as it has workers; its folder is $work/NAME.
run_solver() {
  local name=$1 ranks=$2 threads=$3 case=$4 on=$core
  shift 4
  need_solver
  [ $((ranks * threads)) -eq 1 ] || on=$cores
  local launch=(taskset -c "$on")
  [ "$ranks" -eq 1 ] || launch+=(mpirun --oversubscribe --bind-to none -n "$ranks")
  rm -rf "${work:?}/$name"
  # The number of threads is an option; the environment would be another.
  if ! (
    unset RAYON_NUM_THREADS
    limited "${launch[@]}" "$solver" "$case" --threads "$threads" --output "$work/$name" \
      --no-final-checkpoint "$@"
  ) >"$work/$name.log" 2>&1; then
    tail -n 5 "$work/$name.log" | cut -c1-300 >&2
    echo "beside_peers: the solver failed on $case" >&2
    return 1
  fi
}

summary() { field "$2" <"$work/$1/summary.json"; }

# bandwidth THREADS: GB/s of an update in place.
bandwidth() {
  local on=$core size=1024
  [ "$1" -eq 1 ] || on=$cores
  [ "$quick" -eq 0 ] || size=128
  make_probe
  OMP_NUM_THREADS=$1 limited taskset -c "$on" "$folder/bandwidth" "$size" 7 | field update.0
}

# state NAME: the unpacked CSV of a state of the peers.
state() {
  [ -s "$folder/$1.csv" ] || python3 "$here/peers/states.py" unpack "$1" "$folder/$1.csv"
  echo "$folder/$1.csv"
}

# sample NAME [ROWS]: the same as a sample of the solver, or its first rows.
sample() {
  [ -s "$folder/$1.sample.csv" ] || python3 "$here/peers/states.py" sample "$1" "$folder/$1.sample.csv"
  if [ $# -gt 1 ]; then
    sed -n "1,$(($2 + 1))p" "$folder/$1.sample.csv" >"$work/$1.$2.csv"
    echo "$work/$1.$2.csv"
  else
    echo "$folder/$1.sample.csv"
  fi
}

# --- P-1: fluid only, whole program, one core ---
cells=2400
cavity=()
[ "$quick" -eq 0 ] || {
  cells=400
  cavity=(--set 'domain.size=[0.004, 0.004]' --set time.end=0.0005)
}
p1_ours() {
  run_solver cavity 1 1 "$here/cases/cavity.json" "${cavity[@]}"
  ours=$(summary cavity mlups)
}
p1_bandwidth() { probe=$(bandwidth 1); }
p1_kernel() {
  limited taskset -c "$core" "$(peer_python)" "$here/peers/lbmpy_kernel.py" --vectors "$lbmpy_vectors" --stencil D2Q9 --method srt --n "$cells" --repeats 5 "$@" | field mlups.0
}
p1_lbmpy() { peer=$(p1_kernel); }
p1_compressible() { alike=$(p1_kernel --compressible); }
row_P1() {
  local pair ours peer alike probe limit
  for ((pair = 1; pair <= pairs; pair++)); do
    by_turns "$pair" p1_ours p1_bandwidth p1_lbmpy p1_compressible
    record P-1 "D2Q9 BGK ${cells}^2, loop of the whole program" MLUPS "$ours" "$peer" "lbmpy 2.0 AA, bare kernel" rate 0.9 1.05
    record P-1 "the same beside the compressible equilibrium" MLUPS "$ours" "$alike" "lbmpy 2.0 AA, bare kernel, compressible" rate - -
    limit=$(awk -v b="$probe" 'BEGIN { print b * 1e9 / 144 / 1e6 }')
    record P-1 "the same against bandwidth (144 B an update)" MLUPS "$ours" "$limit" "update in place, bandwidth.c" rate 0.85 0.95
  done
}

# --- P-2: piping at the paper's size, coupled, one core ---
# The packing is grown once and kept; PIPING_SAMPLE names one that is there already.
piping_case=$root/jobs/piping_erosion/case.json
piping() {
  local sample=${PIPING_SAMPLE:-$folder/piping/sample.csv} steps=500
  [ "$quick" -eq 0 ] || steps=20
  if [ ! -s "$sample" ]; then
    need_solver
    echo "  growing the packing (once)"
    SOLVER=$solver limited bash "$root/jobs/piping_erosion/study.sh" --scale paper --output "$folder/piping" prepare
  fi
  # The whole program but for files: the pressure at once and as many solid steps as the row says; the peer writes nothing.
  piping_args=(--set "grains.initial={\"file\": {\"path\": \"$sample\"}}" --set grains.save=null
    --set 'fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp=null'
    --set time.solid_steps_per_fluid_step=18 --set "time.end=$(awk -v n="$steps" 'BEGIN { print n * 8e-5 }')"
    --set output='{}' --set 'probes=[]' --set 'analysis={}' --set checkpoint.every_wall_seconds=0)
}
p2_ours() {
  run_solver piping 1 1 "$piping_case" "${piping_args[@]}"
  ours=$(summary piping mlups)
}
p2_yade() {
  local steps=100
  [ "$quick" -eq 0 ] || steps=4
  # It writes logs of its own where it stands.
  peer=$(cd "$work" && NX=777 STEPS=$steps RATIO=18 DP=0.5 limited taskset -c "$core" yade -n -x -j1 "$here/peers/yade_piping.py" 2>/dev/null | field mlups)
}
row_P2() {
  local pair ours peer piping_args
  piping
  for ((pair = 1; pair <= pairs; pair++)); do
    by_turns "$pair" p2_ours p2_yade
    record P-2 "piping 840 x 400, 18 solid steps, whole coupled steps" MLUPS "$ours" "$peer" "YADE 2023.02a HydrodynamicsLawLBM" rate 15 30
  done
}

# --- P-3 to P-5: D3Q27, fluid only, whole program, one core ---
edge=200
cavity_3d=()
[ "$quick" -eq 0 ] || {
  edge=48
  cavity_3d=(--set 'domain.size=[0.00048, 0.00048, 0.00048]' --set time.end=6e-5)
}
# lbmpy_3d ARGS...: million updates a second of its bare kernel of as many cells.
lbmpy_3d() {
  limited taskset -c "$core" "$(peer_python)" "$here/peers/lbmpy_kernel.py" --vectors "$lbmpy_vectors" --stencil D3Q27 --n "$edge" --repeats 5 "$@" | field mlups.0
}
# Ours with the moments above the second at one rate of 1, as the peer takes them by default, and with the rates of Suga.
ours_3d() {
  run_solver cavity_3d 1 1 "$here/cases/cavity_3d.json" "${cavity_3d[@]}" "${model[@]}" \
    --set 'fluid.lattice_boltzmann.collision={"mrt": {"higher": 1}}'
  ours=$(summary cavity_3d mlups)
}
suga_3d() {
  run_solver cavity_3d 1 1 "$here/cases/cavity_3d.json" "${cavity_3d[@]}" "${model[@]}"
  suga=$(summary cavity_3d mlups)
}
raw_3d() { raw=$(lbmpy_3d --method mrt_raw "${peer_model[@]}"); }
central_3d() { central=$(lbmpy_3d --method central "${peer_model[@]}"); }
many_3d() { many=$(lbmpy_3d --method mrt_raw --rates many "${peer_model[@]}"); }
# row_3d ROW QUANTITY BAR AIM: the model of the caller beside the faster of the peer's two, or its central moments alone where
# there are eddies, which its raw moments do not come with; and with a rate for each moment beside the same.
row_3d() {
  local pair ours suga raw central many peer others=(raw_3d central_3d many_3d)
  # The peer's raw moments come without eddy viscosity.
  [[ " ${peer_model[*]} " != *" --sgs "* ]] || others=(central_3d)
  for ((pair = 1; pair <= pairs; pair++)); do
    raw=0 many=0
    by_turns "$pair" ours_3d suga_3d "${others[@]}"
    peer=$(printf '%s\n' "$raw" "$central" | sort -g | tail -n 1)
    record "$1" "$2" MLUPS "$ours" "$peer" "lbmpy 2.0 AA, bare kernel" rate "$3" "$4"
    if [ "${#others[@]}" -eq 1 ]; then
      record "$1" "$2: rates of Suga" MLUPS "$suga" "$peer" "lbmpy 2.0 AA, bare kernel" rate "$3" "$4"
    else
      record "$1" "$2: rates of Suga" MLUPS "$suga" "$many" "lbmpy 2.0 AA, bare kernel, a rate for each moment" rate "$3" "$4"
      record "$1" "$2: beside central moments" MLUPS "$ours" "$central" "lbmpy 2.0 AA, bare kernel, central moments" rate - -
    fi
  done
}
row_P3() {
  local model=() peer_model=()
  row_3d P-3 "D3Q27 MRT $edge^3, loop of the whole program" 1.0 1.2
}
row_P4() {
  local peer_model=(--sgs smagorinsky --force)
  local model=(--set 'fluid.lattice_boltzmann.turbulence={"wale": {}}' --set 'fluid.lattice_boltzmann.body_force={"constant": [10, 0, 0]}')
  row_3d P-4 "D3Q27 MRT, WALE and force $edge^3, loop of the whole program" 0.9 1.2
}
row_P5() {
  local model=(--set fluid.lattice_boltzmann.storage=f32) peer_model=(--precision mixed)
  row_3d P-5 "D3Q27 MRT $edge^3, f32 at rest, loop of the whole program" 1.0 1.3
  model=(--set fluid.lattice_boltzmann.storage=f32 --set fluid.lattice_boltzmann.arithmetic=f32) peer_model=(--precision single)
  row_3d P-5 "D3Q27 MRT $edge^3, arithmetic in f32, loop of the whole program" 1.0 1.3
}

# --- P-6: moving spheres in partially saturated cells, whole step, one core ---
# waLBerla is in no distribution; its 3.7 MLUPS (D3Q19) were measured where lbmpy's D3Q27 SRT kernel ran at 104, so that kernel
# beside ours says what it would do here.
p6_ours() {
  run_solver wet_spheres 1 1 "$here/cases/spheres_in_water.json" --set "grains.initial.file.path=$work/spheres.csv" "${wet[@]}"
  ours=$(summary wet_spheres mlups)
}
p6_lbmpy() { kernel=$(lbmpy_3d --method srt); }
# With waLBerla's own binary: the same spheres in its D3Q19 with one rate, and in ours.
p6_alike() {
  run_solver wet_alike 1 1 "$here/cases/spheres_in_water.json" --set "grains.initial.file.path=$work/spheres.csv" "${wet[@]}" \
    --set fluid.lattice_boltzmann.lattice=d3q19 --set 'fluid.lattice_boltzmann.collision={"bgk": {}}'
  alike=$(summary wet_alike mlups)
}
p6_walberla() {
  local steps=60
  [ "$quick" -eq 0 ] || steps=10
  peer=$(limited python3 "$here/peers/walberla.py" spheres "$WALBERLA_FLUIDIZED_BED" --steps "$steps" --core "$core" | field mlups)
}
row_P6() {
  local pair ours kernel alike peer wet=() others=(p6_lbmpy)
  [ -z "${WALBERLA_FLUIDIZED_BED:-}" ] || others=(p6_alike p6_walberla)
  [ "$quick" -eq 0 ] || wet=(--set time.end=5e-4)
  awk 'BEGIN {
    srand(1); print "x,y,z,radius"
    for (k = 0; k < 343; k++) {
      for (a = 0; a < 3; a++) q[a] = ((int(k / 7 ^ a) % 7 + 0.5) / 7) * 0.0128 + (rand() - 0.5) * 2e-4
      printf "%.9g,%.9g,%.9g,0.0008\n", q[0], q[1], q[2]
    } }' >"$work/spheres.csv"
  for ((pair = 1; pair <= pairs; pair++)); do
    by_turns "$pair" p6_ours "${others[@]}"
    if [ -n "${WALBERLA_FLUIDIZED_BED:-}" ]; then
      record P-6 "343 moving spheres, D3Q27 MRT, partially saturated cells, whole step" MLUPS "$ours" "$peer" \
        "waLBerla FluidizedBedPSM, D3Q19 SRT" rate 5 10
      record P-6 "the same in D3Q19, BGK" MLUPS "$alike" "$peer" "waLBerla FluidizedBedPSM, D3Q19 SRT" rate - -
    else
      record P-6 "343 moving spheres, D3Q27 MRT, partially saturated cells, whole step; peer scaled" MLUPS "$ours" \
        "$(awk -v k="$kernel" 'BEGIN { print 3.7 * k / 104 }')" "waLBerla, D3Q19, from the anchor of another machine by lbmpy" rate 5 10
    fi
    shares P-6 wet_spheres
  done
}
# shares ROW RUN: the phases of a run beside the split of the scour paper.
shares() {
  local phase paper
  for phase in fluid:0.3:collision mapping:0.2:mapping output:0.3:output; do
    IFS=: read -r phase paper name <<<"$phase"
    record "$1" "share of the loop: $phase" - "$(python3 -c '
import json, sys
run = json.load(open(sys.argv[1]))
seconds = {one["phase"]: one["mean"] for one in run["phases"]}
print(round(seconds[sys.argv[2]] / run["loop_seconds"], 4))' "$work/$2/summary.json" "$phase")" "$paper" "scour paper: $name" limit - -
  done
}

# --- P-7: spheres, one core ---
p7_ours() {
  local line
  line=$(limited taskset -c "$core" "$dem" "$(state "$state")")
  # The mean over all steps with the rebuilds of lists: what the peers report.
  ours=$(sed -n 's/.*(mean \([0-9.]*\),.*/\1/p' <<<"$line")
}
p7_peer() {
  limited python3 "$here/peers/grains.py" --code "$1" --scene "$scene" --cores "$core" --steps "$steps" |
    field particle_steps_per_second | awk '{ print $1 / 1e6 }'
}
p7_lammps() { lammps=$(p7_peer lammps); }
p7_liggghts() { liggghts=$(p7_peer liggghts); }
row_P7() {
  local pair scene state ours lammps liggghts dem peer name steps=300
  [ "$quick" -eq 0 ] || steps=20
  dem=$(bench_binary "${DEM_BENCH:-}" dem)
  for scene in box packed cloud; do
    case $scene in
      box) state=box_packed ;;
      packed) state=fissure_packed ;;
      cloud) state=fissure_cloud ;;
    esac
    for ((pair = 1; pair <= pairs; pair++)); do
      by_turns "$pair" p7_ours p7_lammps p7_liggghts
      record P-7 "$scene: every pair against LAMMPS" "M particle-steps/s" "$ours" "$lammps" "LAMMPS (Debian)" rate - -
      record P-7 "$scene: every pair against LIGGGHTS" "M particle-steps/s" "$ours" "$liggghts" "LIGGGHTS 3.8 (Debian)" rate - -
      peer=$(printf '%s\n' "$lammps" "$liggghts" | sort -g | tail -n 1)
      name="the faster of LAMMPS and LIGGGHTS"
      record P-7 "$scene" "M particle-steps/s" "$ours" "$peer" "$name" rate 1.1 2
    done
  done
}

# --- P-8: a pile of blocks, one core ---
p8_ours() {
  ours=$(limited taskset -c "$core" "$blocks" pile "$count" "$settle" "$work/pile.json" | sed -n 's/^pile: \([0-9]*\) contacts.*/\1/p')
}
p8_yade() {
  peer=$(cd "$work" && PILE=pile.json limited taskset -c "$core" yade -n -x -j1 "$here/peers/yade_blocks.py" 2>/dev/null | field contacts_per_second)
}
row_P8() {
  local pair ours peer blocks count=1000 settle=6000
  [ "$quick" -eq 0 ] || count=40 settle=600
  blocks=$(bench_binary "${BLOCKS_BENCH:-}" blocks)
  # The pile from which the peer starts.
  p8_ours
  for ((pair = 1; pair <= pairs; pair++)); do
    by_turns "$pair" p8_ours p8_yade
    record P-8 "pile of $count random convex blocks" contacts/s "$ours" "$peer" "YADE 2023.02a polyhedra" rate 20 100
  done
}

# --- P-9: Darcy, one core ---
p9_ours() {
  limited taskset -c "$core" "$darcy" "$grid" 1e-8 5 >"$work/darcy.log"
  ours=$(sed -n 's/^[0-9]* cells: \([0-9.e+-]*\) s .*/\1/p' "$work/darcy.log")
  flow=$(sed -n 's/.*flow \([0-9.e+-]*\) m3.*/\1/p' "$work/darcy.log")
}
p9_fipy() {
  limited taskset -c "$core" "$(peer_python)" "$here/peers/fipy_darcy.py" --cells "$grid" --tolerance 1e-8 --repeats 3 >"$work/fipy.log"
  peer=$(field seconds.0 <"$work/fipy.log")
  theirs=$(field flow <"$work/fipy.log")
}
row_P9() {
  local pair ours peer grid darcy bar aim flow theirs grids="6x20x6 60x200x60"
  [ "$quick" -eq 0 ] || grids="6x20x6 12x40x12"
  darcy=$(bench_binary "${DARCY_BENCH:-}" darcy)
  for grid in $grids; do
    if [ "$grid" = 6x20x6 ]; then bar=20 aim=100; else bar=5 aim=20; fi
    for ((pair = 1; pair <= pairs; pair++)); do
      by_turns "$pair" p9_ours p9_fipy
      # Both must have solved the same problem.
      if ! awk -v a="$flow" -v b="$theirs" 'BEGIN { d = a / b - 1; exit !(d < 1e-5 && d > -1e-5) }'; then
        echo "beside_peers: P-9 $grid: the flows differ: ours $flow, FiPy $theirs m3/s" >&2
        return 1
      fi
      record P-9 "Darcy $grid cells: assemble, solve, gradient" s "$ours" "$peer" "FiPy 4.0.3 (SciPy, conjugate gradients)" time "$bar" "$aim"
    done
  done
}

# --- P-10: two ranks and two threads over one ---
p10_one() {
  run_solver one 1 1 "$scene_case" "${scene_args[@]}"
  one=$(summary one "$key")
}
p10_ranks() {
  run_solver ranks 2 1 "$scene_case" "${scene_args[@]}"
  ranks=$(summary ranks "$key")
}
p10_threads() {
  run_solver threads 1 2 "$scene_case" "${scene_args[@]}"
  threads=$(summary threads "$key")
}
p10_lammps_one() { lammps_one=$(limited python3 "$here/peers/grains.py" --code lammps --scene box --cores "$core" --steps "$steps" | field particle_steps_per_second); }
p10_lammps_two() { lammps_two=$(limited python3 "$here/peers/grains.py" --code lammps --scene box --cores "$cores" --ranks 2 --steps "$steps" | field particle_steps_per_second); }
p10_bandwidth_one() { bandwidth_one=$(bandwidth 1); }
p10_bandwidth_two() { bandwidth_two=$(bandwidth 2); }
same_state() {
  if [ "$(summary one state_hash)" != "$(summary "$1" state_hash)" ]; then
    echo "beside_peers: P-10 $scene: the state on $1 is another one than on one core" >&2
    return 1
  fi
}
row_P10() {
  local pair scene scene_case scene_args key one ranks threads bar aim unit steps=300 lammps_one lammps_two bandwidth_one bandwidth_two piping_args
  [ "$quick" -eq 0 ] || steps=20
  if [ "$(nproc --all)" -lt 2 ]; then
    echo "beside_peers: P-10 needs two cores" >&2
    return 1
  fi
  for scene in cavity piping spheres stream; do
    key=mlups unit=MLUPS
    local extra=()
    case $scene in
      cavity)
        scene_case=$here/cases/cavity.json scene_args=("${cavity[@]}")
        extra=(p10_bandwidth_one p10_bandwidth_two)
        ;;
      piping)
        piping
        scene_case=$piping_case scene_args=("${piping_args[@]}")
        ;;
      spheres)
        scene_case=$here/cases/spheres.json key=particle_steps_per_second unit=particle-steps/s
        scene_args=(--set "grains.initial.file.path=$(sample box_packed)" --set "time.end=$(awk -v n="$steps" 'BEGIN { print n * 1e-5 }')")
        extra=(p10_lammps_one p10_lammps_two)
        ;;
      stream)
        scene_case=$root/jobs/rock_scour/incline.json
        scene_args=(--set 'probes=[]' --set 'output={}' --set "time.end=$(awk -v n="$steps" 'BEGIN { print n * 2.5e-4 }')")
        ;;
    esac
    for ((pair = 1; pair <= pairs; pair++)); do
      by_turns "$pair" p10_one "${extra[@]}" p10_ranks p10_threads
      same_state ranks
      same_state threads
      bar=1.7 aim=1.9
      if [ "$scene" = cavity ]; then
        bar=$(awk -v a="$bandwidth_one" -v b="$bandwidth_two" 'BEGIN { printf "%.3f\n", 0.95 * b / a }')
        aim=$bar
        record P-10 "bandwidth of two cores over one" GB/s "$bandwidth_two" "$bandwidth_one" "update in place on one core, bandwidth.c" rate - -
      fi
      record P-10 "$scene: two ranks" "$unit" "$ranks" "$one" "itself, one rank" rate "$bar" "$aim"
      record P-10 "$scene: two threads" "$unit" "$threads" "$one" "itself, one thread" rate "$bar" "$aim"
      if [ "$scene" = spheres ]; then
        record P-10 "LAMMPS, the same spheres: two ranks" particle-steps/s "$lammps_two" "$lammps_one" "LAMMPS (Debian), one rank" rate - -
      fi
    done
  done
}

# --- P-11: every field of a 3-D scene every 100 steps ---
row_P11() {
  local pair share every
  every=$(awk 'BEGIN { print 100 * 0.2 / 3 * 1e-10 / 1e-6 }')
  for ((pair = 1; pair <= pairs; pair++)); do
    quiet
    run_solver fields 1 1 "$here/cases/cavity_3d.json" --set 'domain.size=[0.00128, 0.00128, 0.00128]' --set 'fluid.lattice_boltzmann.turbulence={"wale": {}}' \
      --set "time.end=$(awk -v e="$every" 'BEGIN { print 3 * e }')" --set "output={\"fluid\": {\"every\": $every}}"
    share=$(python3 -c '
import json, sys
run = json.load(open(sys.argv[1]))
print(round({one["phase"]: one["mean"] for one in run["phases"]}["output"] / run["loop_seconds"], 5))' "$work/fields/summary.json")
    record P-11 "fields of 128^3 cells, D3Q27 MRT and WALE, every 100 steps: share of the loop" - "$share" 1 "the whole loop" limit 0.05 0.02
  done
}

# --- P-12: cost of a grain against the number of grains and the range of sizes ---
row_P12() {
  local pair dem quantity unit ours peer name bar aim
  dem=$(bench_binary "${DEM_BENCH:-}" dem)
  for ((pair = 1; pair <= pairs; pair++)); do
    quiet
    limited taskset -c "$core" "$dem" scaling >"$work/scaling.log"
    python3 "$here/table.py" scaling <"$work/scaling.log" >"$work/scaling.tsv"
    while IFS=$'\t' read -r quantity unit ours peer name bar aim; do
      record P-12 "$quantity" "$unit" "$ours" "$peer" "$name" limit "$bar" "$aim"
    done <"$work/scaling.tsv"
  done
}

# --- P-13: memory ---
row_P13() {
  local pair small large edge size rows bytes precision bar=1
  for ((pair = 1; pair <= pairs; pair++)); do
    for precision in f64 f32; do
      # The difference of 1.4 and 5.8 million cells: what does not grow is out of it.
      for edge in 1200 2400; do
        [ "$quick" -eq 0 ] || edge=$((edge / 4))
        size=$(awk -v n="$edge" 'BEGIN { print n * 1e-5 }')
        run_solver "memory$edge" 1 1 "$here/cases/cavity.json" --set "domain.size=[$size, $size]" --set time.end=4e-5 \
          --set "fluid.lattice_boltzmann.storage=$precision"
      done
      small=$(summary "memory$((edge / 2))" peak_rss_bytes)
      large=$(summary "memory$edge" peak_rss_bytes)
      bytes=$(awk -v a="$small" -v b="$large" -v n="$edge" 'BEGIN { print (b - a) / (0.75 * n * n) }')
      record P-13 "D2Q9 $precision: bytes of a cell" B "$bytes" "$([ $precision = f64 ] && echo 98.8 || echo 57.4)" \
        "1.15 x 9 numbers + 16 B" limit "$bar" 1
    done
    for rows in 50000 100000; do
      run_solver "grains$rows" 1 1 "$here/cases/spheres.json" --set "grains.initial.file.path=$(sample box_packed "$rows")" --set time.end=3e-4
    done
    small=$(summary grains50000 peak_rss_bytes)
    large=$(summary grains100000 peak_rss_bytes)
    bytes=$(awk -v a="$small" -v b="$large" 'BEGIN { print (b - a) / 50000 }')
    record P-13 "packed spheres: bytes of a grain" B "$bytes" 700 "LAMMPS, 700 B" limit "$bar" 1
  done
}

# --- P-14: a standing wave with a free surface, one core ---
p14_ours() {
  run_solver wave 1 1 "$work/wave.json"
  ours=$(p14_cost)
}
p14_default() {
  run_solver wave_default 1 1 "$work/wave_default.json"
  usual=$(p14_cost _default)
}
# Nanoseconds per cell of water and step.
p14_cost() { awk -v s="$(summary "wave${1:-}" loop_seconds)" -v n="$water" -v k="$steps" 'BEGIN { print s / (n * k) * 1e9 }'; }
p14_walberla() {
  peer=$(limited python3 "$here/peers/walberla.py" wave "$binary" --cells "$cells_of_water" --box "$box" --blocks "$blocks" \
    --steps "$steps" --core "$core" | field ns_per_water_cell)
}
row_P14() {
  local pair ours usual peer binary cells_of_water box blocks water steps=100 scene name scenes=(
    # Variable, cells of the water, height of the box over the depth, blocks of waLBerla: the fewest, but air in blocks of its own.
    "WALBERLA_GRAVITY_WAVE 768x384 1.25 1x1x1"
    "WALBERLA_GRAVITY_WAVE 768x384 10 1x8x1"
    "WALBERLA_GRAVITY_WAVE_3D 96x96x48 1.25 1x1x1"
    "WALBERLA_GRAVITY_WAVE_3D 96x96x48 10 1x8x1"
  )
  if [ "$quick" -eq 1 ]; then
    steps=10
    scenes=("WALBERLA_GRAVITY_WAVE 96x48 1.25 1x1x1" "WALBERLA_GRAVITY_WAVE_3D 32x32x16 1.25 1x1x1")
  fi
  for scene in "${scenes[@]}"; do
    read -r name cells_of_water box blocks <<<"$scene"
    binary=${!name:-}
    if [ -z "$binary" ]; then
      echo "beside_peers: P-14 without $cells_of_water cells, box of $box depths: $name names no binary of waLBerla (benches/peers/walberla.py)" >&2
      continue
    fi
    water=$((${cells_of_water//x/ * }))
    python3 "$here/peers/walberla.py" case --cells "$cells_of_water" --box "$box" --steps "$steps" --operator bgk >"$work/wave.json"
    python3 "$here/peers/walberla.py" case --cells "$cells_of_water" --box "$box" --steps "$steps" >"$work/wave_default.json"
    for ((pair = 1; pair <= pairs; pair++)); do
      by_turns "$pair" p14_ours p14_default p14_walberla
      name="waLBerla GravityWave, SRT"
      record P-14 "wave on $cells_of_water cells of water, box of $box depths, BGK" "ns/cell" "$ours" "$peer" "$name" time - -
      record P-14 "the same with our default TRT, $cells_of_water, $box" "ns/cell" "$usual" "$peer" "$name" time - -
    done
  done
}

header() {
  local commit solver_commit
  # Rows of the benches alone leave no summary.
  solver_commit=$( (sed -n 's/.*"commit": "\(.*\)".*/\1/p' "$work"/*/summary.json 2>/dev/null || true) | sort -u | tr '\n' ' ')
  commit=$(git -C "$root" rev-parse --short=12 HEAD 2>/dev/null || echo unknown)
  [ -z "$(git -C "$root" status --porcelain --untracked-files=no 2>/dev/null)" ] || commit="$commit with changes"
  echo "# commit: $commit"
  [ -z "$solver_commit" ] || echo "# solver built from: $solver_commit"
  echo "# date: $(date -u +%Y-%m-%dT%H:%M:%SZ)"
  echo "# machine: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc --all) cores, $(awk '/MemTotal/ { printf "%.0f GB", $2 / 1e6 }' /proc/meminfo), $(uname -sr)"
  echo "# vectors: $(grep -m 1 '^flags' /proc/cpuinfo | tr ' ' '\n' | grep -E '^(avx|avx2|avx512f|fma)$' | tr '\n' ' ')$([ "$avx2" -eq 0 ] || echo '; solver and lbmpy limited to avx2')"
  echo "# compilers: $(rustc --version 2>/dev/null || echo 'no rustc'); $(cc --version | head -n 1)"
  echo "# command: $command_line"
  echo "# pairs: $pairs, by turns; cores $cores, rows of one core on core $core"
  if [ -s "$work/idle" ]; then
    echo "# idle share of the machine before each pair: $(sort -g "$work/idle" | sed -n '1p;$p' | tr '\n' ' ')(least, most)"
  fi
  [ ! -e "$work/busy" ] || echo "# BUSY: measured with --busy-ok while other processes loaded the machine; not a record"
  [ "$quick" -eq 0 ] || echo "# QUICK: tiny sizes to try the script; not a record"
}

failed=()
for row in "${rows[@]}"; do
  echo "$row"
  rm -f "$work/idle" "$work/busy" "$work/$row.tsv"
  : >"$work/idle"
  missing=$(peer_packages "$row" | tr '\n' ' ')
  if [ -n "${missing// /}" ]; then
    echo "beside_peers: $row needs $missing: call with --install" >&2
    failed+=("$row")
    continue
  fi
  # In a subshell with its own `set -e`, which a condition would switch off.
  set +e
  (
    set -e
    "row_${row/-/}"
  )
  status=$?
  set -e
  if [ "$status" -ne 0 ]; then
    failed+=("$row")
    continue
  fi
  # Rows whose peer is not there are left out, and said so.
  [ -s "$work/$row.tsv" ] || continue
  header >"$work/header"
  python3 "$here/table.py" row "$row" "$work/$row.tsv" "$work/header" "$results/$row.csv"
done

python3 "$here/table.py" picture "$results"
python3 "$here/table.py" show "$results"
echo "results in $results"
if [ "${#failed[@]}" -gt 0 ]; then
  echo "beside_peers: not measured: ${failed[*]}" >&2
  exit 1
fi
