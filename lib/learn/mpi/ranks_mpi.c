// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module that joins a process to an MPI job; see incise/ranks.h. Numbers of bytes are below
 * 2³¹ in MPI's calls: larger messages go in pieces.
 */
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <mpi.h>
#include <incise/ranks.h>

#define PIECE ((size_t)1 << 30)
#define TAG 1

static struct incise_ranks ranks;

static void send_bytes(int rank, const void *bytes, size_t n)
{
	uint64_t size = n;

	MPI_Send(&size, 1, MPI_UINT64_T, rank, TAG, MPI_COMM_WORLD);
	for (size_t at = 0; at < n; at += PIECE)
		MPI_Send((const char *)bytes + at, (int)(n - at < PIECE ? n - at : PIECE),
			 MPI_BYTE, rank, TAG, MPI_COMM_WORLD);
}

static void *receive_bytes(int rank, size_t *n)
{
	uint64_t size;
	char *bytes;

	MPI_Recv(&size, 1, MPI_UINT64_T, rank, TAG, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
	*n = size;
	bytes = malloc(size + 1);
	for (size_t at = 0; at < size && bytes; at += PIECE)
		MPI_Recv(bytes + at, (int)(size - at < PIECE ? size - at : PIECE),
			 MPI_BYTE, rank, TAG, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
	return bytes;
}

/* Each rank's bytes are broadcast in turn. */
static int gather_ranks_mpi(const void *bytes, size_t n, void **all, size_t **sizes)
{
	uint64_t mine = n, *counts = malloc(ranks.size * sizeof(*counts));
	size_t total = 0, at = 0;
	char *to = NULL;

	*all = NULL;
	*sizes = malloc(ranks.size * sizeof(**sizes));
	if (!counts || !*sizes)
		goto failed;
	MPI_Allgather(&mine, 1, MPI_UINT64_T, counts, 1, MPI_UINT64_T, MPI_COMM_WORLD);
	for (int r = 0; r < ranks.size; r++) {
		(*sizes)[r] = counts[r];
		total += counts[r];
	}
	*all = to = malloc(total + 1);
	if (!to)
		goto failed;
	for (int r = 0; r < ranks.size; r++) {
		size_t size = (*sizes)[r];

		if (r == ranks.rank && n)
			memcpy(to + at, bytes, n);
		for (size_t i = 0; i < size; i += PIECE)
			MPI_Bcast(to + at + i, (int)(size - i < PIECE ? size - i : PIECE),
				  MPI_BYTE, r, MPI_COMM_WORLD);
		at += size;
	}
	free(counts);
	return 0;
failed:
	free(counts);
	free(*sizes);
	*sizes = NULL;
	return -ENOMEM;
}

static void leave(int failed)
{
	if (failed)
		MPI_Abort(MPI_COMM_WORLD, 1);
	MPI_Finalize();
}

INCISE_API const struct incise_ranks *incise_ranks_join(void);
const struct incise_ranks *incise_ranks_join(void)
{
	if (MPI_Init(NULL, NULL))
		return NULL;
	MPI_Comm_rank(MPI_COMM_WORLD, &ranks.rank);
	MPI_Comm_size(MPI_COMM_WORLD, &ranks.size);
	ranks.gather = gather_ranks_mpi;
	ranks.send = send_bytes;
	ranks.receive = receive_bytes;
	ranks.close = leave;
	return &ranks;
}
