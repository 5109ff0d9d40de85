/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The processes of an MPI job, for training on many computers. A module on Open MPI,
 * ranks_mpi.so, is loaded by incise_ranks_open(); nothing else maps it. All functions are called
 * by all ranks in the same order, from one thread. Part of libincise-learn.
 */
#ifndef INCISE_RANKS_H
#define INCISE_RANKS_H

#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Functions of the module, and the rank of this process. */
struct incise_ranks {
	int rank, size; /**< 0 ≤ rank < size */
	/**
	 * Exchange bytes with all: @all has the bytes of rank 0, 1, …, one after another, with
	 * their numbers in @sizes (size of them); free both with free(3). 0 or -ENOMEM.
	 */
	int (*gather)(const void *bytes, size_t n, void **all, size_t **sizes);
	/** Send bytes to one rank, which receives them. */
	void (*send)(int rank, const void *bytes, size_t n);
	/** To be freed with free(3); NULL: no memory. */
	void *(*receive)(int rank, size_t *n);
	/** End together with all others; or, with a failure that they do not share, end them. */
	void (*close)(int failed);
};

/**
 * Join the other processes of the job; once in a process.
 *
 * @param ranks result, static
 * @return 0; -ENOENT (no module), -ENOEXEC (it is broken), -EIO (not in a job)
 */
INCISE_API int incise_ranks_open(const struct incise_ranks **ranks,
				 struct incise_error *err);

INCISE_END_DECLS
#endif
