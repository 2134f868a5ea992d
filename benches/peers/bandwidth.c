// Bandwidth of the machine: what a memory-bound kernel can at best move (P-1, P-10).
//
//   cc -O3 -march=native -fopenmp bandwidth.c -o bandwidth
//   OMP_NUM_THREADS=1 taskset -c 0 ./bandwidth [MiB per array = 1024] [repeats = 7]
//
// One JSON line: GB/s on the bus of an update in place (a = s a: every line is read and written once, as an in-place
// lattice does), of a copy with ordinary stores (three streams on the bus: the store reads its line first) and of reading;
// each [median, least, most]. After STREAM (McCalpin 1995), without its two-array kernels. Runs on any processor: the
// compiler chooses the vectors.
#define _GNU_SOURCE
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>

static int by_size(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double *array(size_t n) {
  double *p = aligned_alloc(2 << 20, n * sizeof *p);
  if (!p) {
    perror("bandwidth");
    exit(1);
  }
  // Before the first touch.
  madvise(p, n * sizeof *p, MADV_HUGEPAGE);
  return p;
}

int main(int count, char **words) {
  size_t mib = count > 1 ? strtoul(words[1], 0, 10) : 1024, n = mib << 17;
  int repeats = count > 2 ? atoi(words[2]) : 7;
  if (mib < 1 || repeats < 1 || repeats > 64) {
    fprintf(stderr, "bandwidth: [MiB per array >= 1] [repeats 1 to 64]\n");
    return 2;
  }
  double *a = array(n), *b = array(n), took[3][64];
  volatile double keep = 0;
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < n; i++) {
    a[i] = 1;
    b[i] = 2;
  }
  for (int r = -1; r < repeats; r++) {
    double t[4], sum = 0;
    t[0] = omp_get_wtime();
#pragma omp parallel for simd schedule(static)
    for (size_t i = 0; i < n; i++) a[i] *= 1.0000001;
    t[1] = omp_get_wtime();
#pragma omp parallel for simd schedule(static)
    for (size_t i = 0; i < n; i++) b[i] = a[i] + keep;
    t[2] = omp_get_wtime();
#pragma omp parallel for simd schedule(static) reduction(+ : sum)
    for (size_t i = 0; i < n; i++) sum += a[i];
    t[3] = omp_get_wtime();
    keep = 1e-30 * sum;
    for (int k = 0; r >= 0 && k < 3; k++) took[k][r] = t[k + 1] - t[k];
  }
  const char *names[3] = {"update", "copy", "read"};
  const double bytes[3] = {16, 24, 8};
  printf("{\"threads\": %d, \"MiB\": %zu", omp_get_max_threads(), mib);
  for (int k = 0; k < 3; k++) {
    qsort(took[k], repeats, sizeof(double), by_size);
    double moved = bytes[k] * n * 1e-9;
    printf(", \"%s\": [%.2f, %.2f, %.2f]", names[k], moved / took[k][repeats / 2], moved / took[k][repeats - 1],
           moved / took[k][0]);
  }
  printf("}\n");
  return 0;
}
