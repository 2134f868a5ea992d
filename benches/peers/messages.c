// What messages between the ranks of this machine cost (scaling.py).
//
//   mpicc -O3 messages.c -o messages; mpirun -n 2 ./messages
//
// One JSON line. `latency`: seconds from one rank to the next of 8 bytes, half of a ping-pong. `exchange`: seconds in which two
// ranks send each other as many bytes as `bytes` says, at the same time, as slabs do. `reduction`: seconds of MPI_Allreduce
// of one number. Each is the least of five series.
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZES = 4, SERIES = 5 };
static const int size_of[SIZES] = {8, 8192, 131072, 2097152};

static double exchange(int other, char *out, char *in, int bytes, int times) {
  double start = MPI_Wtime();
  for (int k = 0; k < times; k++)
    MPI_Sendrecv(out, bytes, MPI_BYTE, other, 0, in, bytes, MPI_BYTE, other, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return (MPI_Wtime() - start) / times;
}

static double ping_pong(int rank, int other, char *buffer, int times) {
  double start = MPI_Wtime();
  for (int k = 0; k < times; k++) {
    if (rank == 0) {
      MPI_Send(buffer, 8, MPI_BYTE, other, 0, MPI_COMM_WORLD);
      MPI_Recv(buffer, 8, MPI_BYTE, other, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    } else {
      MPI_Recv(buffer, 8, MPI_BYTE, other, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
      MPI_Send(buffer, 8, MPI_BYTE, other, 0, MPI_COMM_WORLD);
    }
  }
  return (MPI_Wtime() - start) / times / 2;
}

static double reduction(int times) {
  double start = MPI_Wtime(), sum, one = 1;
  for (int k = 0; k < times; k++)
    MPI_Allreduce(&one, &sum, 1, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  return (MPI_Wtime() - start) / times;
}

int main(int argc, char **argv) {
  MPI_Init(&argc, &argv);
  int rank, ranks;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (ranks != 2) {
    if (rank == 0)
      fprintf(stderr, "messages: two ranks, not %d\n", ranks);
    MPI_Finalize();
    return 2;
  }
  int other = 1 - rank, largest = size_of[SIZES - 1];
  char *out = malloc(largest), *in = malloc(largest);
  if (!out || !in)
    MPI_Abort(MPI_COMM_WORLD, 1);
  memset(out, 1, largest);
  memset(in, 1, largest);
  double latency = 1e9, together = 1e9, exchanges[SIZES];
  for (int s = 0; s < SIZES; s++)
    exchanges[s] = 1e9;
  for (int k = 0; k < SERIES; k++) {
    double t = ping_pong(rank, other, out, 20000);
    latency = t < latency ? t : latency;
    t = reduction(20000);
    together = t < together ? t : together;
    for (int s = 0; s < SIZES; s++) {
      t = exchange(other, out, in, size_of[s], size_of[s] > 100000 ? 200 : 5000);
      exchanges[s] = t < exchanges[s] ? t : exchanges[s];
    }
  }
  if (rank == 0) {
    printf("{\"latency\": %.3g, \"reduction\": %.3g, \"bytes\": [", latency, together);
    for (int s = 0; s < SIZES; s++)
      printf("%s%d", s ? ", " : "", size_of[s]);
    printf("], \"exchange\": [");
    for (int s = 0; s < SIZES; s++)
      printf("%s%.3g", s ? ", " : "", exchanges[s]);
    printf("]}\n");
  }
  free(out);
  free(in);
  MPI_Finalize();
  return 0;
}
