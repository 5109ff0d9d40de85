// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The folder seal/ of a recording: its files, which are untrusted, and the text of a statement in it; see prove.h.
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/recalibration.h>
#include "prove.h"

#define FILES_MAX 1000
#define WORD_CHARACTERS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"

/* --- files: names are only taken if they have the form of ours ----------------------------- */

static const struct {
	const char *extension;
	size_t size_max;
} kinds[] = {
	[INCISE_PROOF_STATEMENT] = {".statement", INCISE_SEAL_STATEMENT_MAX},
	[INCISE_PROOF_SIGNATURE] = {".sig", INCISE_SIGNATURE_MAX},
	[INCISE_PROOF_TIMESTAMP] = {".tsr", INCISE_TIMESTAMP_MAX},
};

/* "12.WORD.sig" or "12.statement". */
static bool parse_name(const char *name, struct incise_seal_file *file)
{
	const char *rest = name + strspn(name, "0123456789");
	size_t word;

	file->number = rest > name && rest - name <= 4 && *name != '0' ? atoi(name) : 0;
	if (!file->number || *rest != '.' || strlen(name) >= sizeof(file->name))
		return false;
	strcpy(file->name, name);
	file->kind = INCISE_PROOF_STATEMENT;
	if (!strcmp(rest, kinds[INCISE_PROOF_STATEMENT].extension))
		return true;
	word = strspn(rest + 1, WORD_CHARACTERS);
	rest += 1 + word;
	for (int k = INCISE_PROOF_SIGNATURE; k <= INCISE_PROOF_TIMESTAMP && word; k++)
		if (!strcmp(rest, kinds[k].extension)) {
			file->kind = (enum incise_proof_kind)k;
			return true;
		}
	return false;
}

/* Read it, or say why not. Returns 0 or -ENOMEM. */
static int read_seal_files_file(int folder, struct incise_seal_file *file)
{
	size_t most = kinds[file->kind].size_max;
	/* A pipe that nobody writes is not waited for. */
	int fd = openat(folder, file->name,
			O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
	char *bytes = calloc(most + 2, 1);
	const char *why = NULL;
	struct stat st;
	ssize_t n = 0;

	if (fd < 0)
		why = errno == ELOOP ? "a link, which is not followed" : strerror(errno);
	else if (fstat(fd, &st) || !S_ISREG(st.st_mode))
		why = "not a regular file";
	else if ((uint64_t)st.st_size > most)
		why = "too large";
	else if (bytes)
		n = read(fd, bytes, most + 1);
	if (n < 0 || (size_t)n > most)
		why = n < 0 ? strerror(errno) : "too large";
	if (fd >= 0)
		close(fd);
	if (bytes && !why) {
		bytes[n] = 0;
		file->content = (struct incise_bytes){bytes, (size_t)n};
		return 0;
	}
	free(bytes);
	snprintf(file->why, sizeof(file->why), "%s", why ? why : "");
	return why ? 0 : -ENOMEM;
}

static int compare_files(const void *a, const void *b)
{
	const struct incise_seal_file *x = a, *y = b;

	if (x->number != y->number)
		return x->number < y->number ? -1 : 1;
	return x->kind != y->kind ? (int)x->kind - (int)y->kind
				  : strcmp(x->name, y->name);
}

/* Returns 0 or -errno. */
static int add_file(struct incise_seal_files *files, int folder, const char *name,
		    const char *path, struct incise_error *err)
{
	struct incise_seal_file file = {.number = 0};

	if (!parse_name(name, &file))
		return 0;
	if (files->n == FILES_MAX)
		return incise_error_set(err, E2BIG,
					"%s: more than %d files; keep those of "
					"signers that count",
					path, FILES_MAX);
	if (read_seal_files_file(folder, &file))
		return incise_error_set(err, ENOMEM, "%s: out of memory", path);
	files->all[files->n++] = file;
	return 0;
}

int incise_seal_files_read(struct incise_seal_files *files, const char *recording,
			   const char *name, struct incise_error *err)
{
	char path[PATH_MAX];
	struct dirent *entry;
	struct stat st;
	DIR *folder;
	int fd, rc = 0;

	*files = (struct incise_seal_files){0};
	snprintf(path, sizeof(path), "%s/%s", recording, name);
	fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
	folder = fd < 0 ? NULL : fdopendir(fd);
	if (!folder && errno == ENOENT)
		return 0;
	if (!folder && errno == ENOTDIR && !stat(recording, &st) && !S_ISDIR(st.st_mode))
		return incise_error_set(
			err, ENOTDIR,
			"%s: not a recording, which is a folder; unpack it "
			"if it is an archive of one",
			recording);
	if (!folder)
		return incise_error_set(err, errno, "%s: %s", path,
					errno == ELOOP || errno == ENOTDIR
						? "not a folder; remove it"
						: strerror(errno));
	files->all = calloc(FILES_MAX, sizeof(*files->all));
	if (!files->all)
		rc = incise_error_set(err, ENOMEM, "%s: out of memory", path);
	while (!rc && (entry = readdir(folder)))
		rc = add_file(files, fd, entry->d_name, path, err);
	if (files->n)
		qsort(files->all, (size_t)files->n, sizeof(*files->all), compare_files);
	closedir(folder);
	return rc;
}

void incise_seal_files_free(struct incise_seal_files *files)
{
	for (int i = 0; i < files->n; i++)
		free(files->all[i].content.bytes);
	free(files->all);
	*files = (struct incise_seal_files){0};
}

/* A folder with anything else in it stays. */
static int remove_folder(const char *recording, const char *name,
			 struct incise_error *err)
{
	struct incise_seal_files files;
	char path[PATH_MAX];
	int rc = incise_seal_files_read(&files, recording, name, err);

	for (int i = 0; i < files.n && !rc; i++) {
		snprintf(path, sizeof(path), "%s/%s/%s", recording, name,
			 files.all[i].name);
		if (unlink(path))
			rc = incise_error_set(err, errno, "%s: cannot be removed: %s",
					      path, strerror(errno));
	}
	incise_seal_files_free(&files);
	snprintf(path, sizeof(path), "%s/%s", recording, name);
	if (!rc && rmdir(path) && errno != ENOENT)
		rc = incise_error_set(err, errno, "%s: cannot be removed: %s", path,
				      strerror(errno));
	return rc;
}

int incise_proof_remove(const char *recording, struct incise_error *err)
{
	int rc = remove_folder(recording, "seal", err);

	return rc ? rc : remove_folder(recording, "seal-before", err);
}

/* --- the text of a statement ----------------------------------------------------------------- */

size_t incise_proof_statement_length(const struct incise_bytes *text)
{
	const char *end = memmem(text->bytes, text->n, "\nend\n", 5);

	return end ? (size_t)(end + 5 - text->bytes) : 0;
}

char *incise_proof_calibrations(const char *recording, struct incise_error *err)
{
	struct incise_recalibration *list = NULL;
	int n = incise_recalibrations(recording, &list, err);
	char *text = NULL;
	size_t size;
	FILE *out = n < 0 ? NULL : open_memstream(&text, &size);

	for (int i = 1; i < n && out; i++)
		fprintf(out, "calibration %s %s\n", list[i].file,
			*list[i].sha256 ? list[i].sha256 : "-");
	free(list);
	if (out && !fclose(out))
		return text;
	if (n < 0)
		errno = -n;
	else
		incise_error_set(err, ENOMEM, "%s: out of memory", recording);
	return NULL;
}
