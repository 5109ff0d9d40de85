// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Progress of a training; see sources.h. The file: a line with the kind, the number of bytes of the
 * key and of each part, then these. The key has the version, the options, and path, size and time of
 * each source, of members of recordings too, with the content of the calibrations in use.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include <incise/version.h>
#include "../cli/cli.h"
#include "sources.h"

#define SHARE 10.0 /* of the time between two writings, at least, to that of one */

struct progress {
	char *path, *key;
	size_t key_size;
	void *part[PROGRESS_PARTS];
	size_t size[PROGRESS_PARTS];
	double last, cost; /* s */
};

static struct progress *of_program; /* whose file goes with it */

static double now(void)
{
	return 1e-9 * (double)cli_now_ns();
}

static void remove_file(void)
{
	unlink(of_program->path);
}

static char *make_key(const char *options, const struct source *sources, int n,
		      size_t *size)
{
	char *key = NULL;
	FILE *out = open_memstream(&key, size);

	if (!out)
		cli_fail("no memory");
	fprintf(out, "%s\n%s\n", incise_version(), options);
	for (int i = 0; i < n; i++) {
		char *state = source_state(&sources[i]);

		fprintf(out, "%s\n%s", sources[i].path, state);
		free(state);
	}
	if (fclose(out))
		cli_fail("no memory");
	return key;
}

/* The progress of another training counts as none. */
static void read_file(struct progress *progress)
{
	static const struct incise_infile_kind kind = {
		.name = "progress of a training",
		.size_max = (uint64_t)1 << 32,
		.regular = true,
	};
	struct incise_error err;
	size_t size, key, n[PROGRESS_PARTS], total;
	char *bytes = access(progress->path, F_OK)
			      ? NULL
			      : incise_infile_read(progress->path, &kind, &size, &err);
	int head = 0;

	if (!bytes)
		return;
	if (sscanf(bytes, "incise progress 1 %zu %zu %zu %zu %zu%n", &key, &n[0], &n[1],
		   &n[2], &n[3], &head) != 5 ||
	    bytes[head] != '\n' || key != progress->key_size)
		goto out;
	head++;
	total = (size_t)head + key;
	for (int p = 0; p < PROGRESS_PARTS; p++) {
		if (n[p] > size)
			goto out;
		total += n[p];
	}
	if (total != size || memcmp(bytes + head, progress->key, key))
		goto out;
	total = (size_t)head + key;
	for (int p = 0; p < PROGRESS_PARTS; total += n[p], p++) {
		progress->part[p] = n[p] ? cli_alloc(n[p], 1) : NULL;
		progress->size[p] = n[p];
		if (n[p])
			memcpy(progress->part[p], bytes + total, n[p]);
	}
out:
	free(bytes);
}

/* A file of another kind, which is not ours to replace or to remove. */
static bool is_foreign(const char *path)
{
	static const char own[] = "incise progress ";
	char head[sizeof(own)] = "";
	FILE *in = fopen(path, "r");

	if (!in)
		return !access(path, F_OK);
	if (fread(head, 1, sizeof(own) - 1, in) != sizeof(own) - 1)
		head[0] = 0;
	fclose(in);
	return strcmp(head, own) != 0;
}

struct progress *progress_new(const char *output, const char *options,
			      const struct source *sources, int n)
{
	struct progress *progress;
	struct stat st;

	if (n < 2 || !strcmp(output, "-") || (!stat(output, &st) && !S_ISREG(st.st_mode)))
		return NULL;
	for (int i = 0; i < n; i++)
		if (!sources[i].recording &&
		    (stat(sources[i].path, &st) || !S_ISREG(st.st_mode)))
			return NULL;
	progress = cli_alloc(1, sizeof(*progress));
	progress->path = cli_text("%s.progress", output);
	if (is_foreign(progress->path)) {
		free(progress->path);
		free(progress);
		return NULL;
	}
	progress->key = make_key(options, sources, n, &progress->key_size);
	read_file(progress);
	progress->last = -1e9;
	of_program = progress;
	atexit(remove_file);
	return progress;
}

const void *progress_part(const struct progress *progress, enum progress_part part,
			  size_t *size)
{
	*size = progress ? progress->size[part] : 0;
	return progress ? progress->part[part] : NULL;
}

void progress_set(struct progress *progress, enum progress_part part, void *bytes,
		  size_t size)
{
	if (!bytes)
		cli_fail("no memory");
	free(progress->part[part]);
	progress->part[part] = bytes;
	progress->size[part] = size;
}

bool progress_due(const struct progress *progress)
{
	return progress && now() - progress->last > SHARE * progress->cost;
}

void progress_write(struct progress *progress)
{
	struct incise_error err;
	struct incise_outfile *file = incise_outfile_open(progress->path, &err);
	double start = now();
	FILE *out;

	if (!file)
		return;
	out = incise_outfile_stream(file);
	fprintf(out, "incise progress 1 %zu", progress->key_size);
	for (int p = 0; p < PROGRESS_PARTS; p++)
		fprintf(out, " %zu", progress->size[p]);
	fputc('\n', out);
	fwrite(progress->key, 1, progress->key_size, out);
	for (int p = 0; p < PROGRESS_PARTS; p++)
		if (progress->size[p])
			fwrite(progress->part[p], 1, progress->size[p], out);
	incise_outfile_commit(file, &err);
	progress->last = now();
	progress->cost = progress->last - start;
}
