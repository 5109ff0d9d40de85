// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Progress of a training; see reader.h. The file: a line with the kind, the SHA-256 of version, options, and
 * names and states of the sources, and the number of bytes of each part; then these.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include <incise/version.h>
#include "../base/monotonic.h"
#include "../base/crypto/sha256.h"
#include "reader.h"

#define KIND "incise progress 1 "
#define SHARE 10.0 /* of the time between two writings, at least, to that of one */

struct incise_progress {
	char *path, key[65];
	void *part[PROGRESS_PARTS];
	size_t size[PROGRESS_PARTS];
	double last, cost; /* s */
};

static double now(void)
{
	return 1e-9 * (double)incise_monotonic_ns();
}

/* False: no memory, or the state of a source is not known. */
static bool make_key(struct incise_progress *progress, const char *options,
		     const struct incise_reader *sources, int n)
{
	struct incise_sha256 sha = {0};
	bool known = true;

	incise_sha256_start(&sha);
	incise_sha256_add(&sha, incise_version(), strlen(incise_version()) + 1);
	incise_sha256_add(&sha, options, strlen(options) + 1);
	for (int i = 0; i < n && known; i++) {
		const char *name = sources[i].given->name;
		char *state = incise_reader_state(&sources[i]);

		known = state;
		incise_sha256_add(&sha, name, strlen(name) + 1);
		if (state)
			incise_sha256_add(&sha, state, strlen(state) + 1);
		free(state);
	}
	return !incise_sha256_end(&sha, progress->key) && known;
}

/* The progress of another training counts as none. */
static void take_parts(struct incise_progress *progress, const char *bytes, size_t size)
{
	size_t n[PROGRESS_PARTS], at, total;
	char key[65];
	int head = 0;

	if (sscanf(bytes, KIND "%64s %zu %zu %zu%n", key, &n[0], &n[1], &n[2], &head) !=
		    1 + PROGRESS_PARTS ||
	    strcmp(key, progress->key) || bytes[head] != '\n')
		return;
	at = total = (size_t)head + 1;
	for (int p = 0; p < PROGRESS_PARTS && total <= size; p++)
		total = n[p] > size ? SIZE_MAX : total + n[p];
	for (int p = 0; p < PROGRESS_PARTS && total == size; at += n[p], p++) {
		void *part = n[p] ? malloc(n[p]) : NULL;

		if (part)
			memcpy(part, bytes + at, n[p]);
		incise_progress_set(progress, (enum incise_progress_part)p, part, n[p]);
	}
}

/* False: a file of another kind, which is not ours to replace or to remove. */
static bool read_progress_file(struct incise_progress *progress)
{
	static const struct incise_infile_kind kind = {
		.name = "progress of a training",
		.size_max = (uint64_t)1 << 32,
		.regular = true,
	};
	size_t size;
	char *bytes;
	bool own;

	if (access(progress->path, F_OK))
		return true;
	bytes = incise_infile_read(progress->path, &kind, &size, NULL);
	own = bytes && !strncmp(bytes, KIND, strlen(KIND));
	if (own)
		take_parts(progress, bytes, size);
	free(bytes);
	return own;
}

struct incise_progress *incise_progress_open(const char *path, const char *options,
					     const struct incise_reader *sources, int n)
{
	struct incise_progress *progress = n > 1 ? calloc(1, sizeof(*progress)) : NULL;

	if (!progress)
		return NULL;
	progress->path = strdup(path);
	progress->last = -1e9;
	if (progress->path && make_key(progress, options, sources, n) &&
	    read_progress_file(progress))
		return progress;
	free(progress->path);
	free(progress);
	return NULL;
}

const void *incise_progress_part(const struct incise_progress *progress,
				 enum incise_progress_part part, size_t *size)
{
	*size = progress ? progress->size[part] : 0;
	return progress ? progress->part[part] : NULL;
}

void incise_progress_set(struct incise_progress *progress, enum incise_progress_part part,
			 void *bytes, size_t size)
{
	free(progress->part[part]);
	progress->part[part] = bytes;
	progress->size[part] = bytes ? size : 0;
}

bool incise_progress_due(const struct incise_progress *progress)
{
	return progress && now() - progress->last > SHARE * progress->cost;
}

void incise_progress_write(struct incise_progress *progress)
{
	struct incise_outfile *file = incise_outfile_open(progress->path, NULL);
	double start = now();
	FILE *out;

	if (!file)
		return;
	out = incise_outfile_stream(file);
	fprintf(out, KIND "%s", progress->key);
	for (int p = 0; p < PROGRESS_PARTS; p++)
		fprintf(out, " %zu", progress->size[p]);
	fputc('\n', out);
	for (int p = 0; p < PROGRESS_PARTS; p++)
		if (progress->size[p])
			fwrite(progress->part[p], 1, progress->size[p], out);
	incise_outfile_commit(file, NULL);
	progress->last = now();
	progress->cost = progress->last - start;
}

void incise_progress_close(struct incise_progress *progress, bool leave)
{
	if (!progress)
		return;
	if (!leave)
		unlink(progress->path);
	for (int p = 0; p < PROGRESS_PARTS; p++)
		free(progress->part[p]);
	free(progress->path);
	free(progress);
}
