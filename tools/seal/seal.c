// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The folder NAME.rec/seal/; see seal.h. A recording may come from anybody: names in it are only
 * taken if they have the form of ours, and no link is followed.
 */
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/outfile.h>
#include <incise/recalibration.h>
#include <incise/session.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "seal.h"

#define NUMBER_MAX 9999
#define STATEMENT_MAX (16 * INCISE_STATEMENT_MAX) /* bytes, with calibrations */
#define WORD_CHARACTERS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"
#define FINGERPRINT_CHARACTERS 16

static const struct {
	const char *extension;
	size_t size_max;
} kinds[] = {
	[SEAL_STATEMENT] = {".statement", STATEMENT_MAX},
	[SEAL_SIGNATURE] = {".sig", SIGNATURE_MAX},
	[SEAL_TIMESTAMP] = {".tsr", TIMESTAMP_MAX},
};

char *seal_recording(const char *path)
{
	char *folder = file_without_choice(path), *part;
	size_t n = strlen(folder);

	while (n > 1 && folder[n - 1] == '/')
		folder[--n] = 0;
	part = cli_text("%s.part", folder);
	if (access(folder, F_OK) && !access(part, F_OK)) {
		free(folder);
		return part;
	}
	free(part);
	return folder;
}

/* --- reading ---------------------------------------------------------------------------- */

/* "12.WORD.sig" or "12.statement". */
static bool parse_name(const char *name, struct seal_file *file)
{
	const char *rest = name + strspn(name, "0123456789");
	size_t word;

	file->number = rest > name && rest - name <= 4 && *name != '0' ? atoi(name) : 0;
	if (!file->number || *rest != '.' || strlen(name) >= sizeof(file->name))
		return false;
	strcpy(file->name, name);
	file->kind = SEAL_STATEMENT;
	if (!strcmp(rest, kinds[SEAL_STATEMENT].extension))
		return true;
	word = strspn(rest + 1, WORD_CHARACTERS);
	rest += 1 + word;
	for (int k = SEAL_SIGNATURE; k <= SEAL_TIMESTAMP && word; k++)
		if (!strcmp(rest, kinds[k].extension)) {
			file->kind = (enum seal_kind)k;
			return true;
		}
	return false;
}

/* Read it, or say why not. */
static void read_file(int folder, struct seal_file *file)
{
	size_t most = kinds[file->kind].size_max;
	/* A pipe that nobody writes is not waited for. */
	int fd = openat(folder, file->name,
			O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
	const char *why = NULL;
	struct stat st;
	ssize_t n = 0;

	if (fd < 0)
		why = errno == ELOOP ? "a link, which is not followed" : strerror(errno);
	else if (fstat(fd, &st) || !S_ISREG(st.st_mode))
		why = "not a regular file";
	else if ((uint64_t)st.st_size > most)
		why = "too large";
	if (!why) {
		file->bytes = cli_alloc(most + 2, 1);
		n = read(fd, file->bytes, most + 1);
		if (n < 0 || (size_t)n > most)
			why = n < 0 ? strerror(errno) : "too large";
	}
	if (why) {
		snprintf(file->why, sizeof(file->why), "%s", why);
		free(file->bytes);
		file->bytes = NULL;
	} else {
		file->bytes[n] = 0;
		file->n = (size_t)n;
	}
	if (fd >= 0)
		close(fd);
}

static int in_order(const void *a, const void *b)
{
	const struct seal_file *x = a, *y = b;

	if (x->number != y->number)
		return x->number < y->number ? -1 : 1;
	return x->kind != y->kind ? (int)x->kind - (int)y->kind
				  : strcmp(x->name, y->name);
}

int seal_files_read(struct seal_files *files, const char *recording, const char *name,
		    struct incise_error *err)
{
	char *path = cli_text("%s/%s", recording, name);
	int fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC), rc = 0;
	DIR *folder = fd < 0 ? NULL : fdopendir(fd);
	struct seal_file file;
	struct dirent *entry;
	struct stat st;

	*files = (struct seal_files){0};
	if (!folder && errno == ENOTDIR && !stat(recording, &st) && !S_ISDIR(st.st_mode))
		rc = incise_error_set(err, ENOTDIR,
				      "%s: not a recording, which is a folder; unpack it "
				      "if it is an archive of one",
				      recording);
	else if (!folder && errno != ENOENT)
		rc = incise_error_set(err, errno, "%s: %s", path,
				      errno == ELOOP || errno == ENOTDIR
					      ? "not a folder; remove it"
					      : strerror(errno));
	while (folder && !rc && (entry = readdir(folder))) {
		file = (struct seal_file){0};
		if (!parse_name(entry->d_name, &file))
			continue;
		if (files->n == SEAL_FILES_MAX) {
			rc = incise_error_set(err, E2BIG,
					      "%s: more than %d files; keep those of "
					      "signers that count",
					      path, SEAL_FILES_MAX);
			break;
		}
		read_file(fd, &file);
		files->all = cli_resize(files->all, (size_t)files->n + 1, sizeof(file));
		files->all[files->n++] = file;
	}
	if (files->n)
		qsort(files->all, (size_t)files->n, sizeof(file), in_order);
	if (folder)
		closedir(folder);
	free(path);
	return rc;
}

void seal_files_free(struct seal_files *files)
{
	for (int i = 0; i < files->n; i++)
		free(files->all[i].bytes);
	free(files->all);
	*files = (struct seal_files){0};
}

/* --- the present statement -------------------------------------------------------------- */

/* A .part that a recorder still writes has a lock on its folder. */
static int check_idle(const char *recording, struct incise_error *err)
{
	int folder = open(recording, O_RDONLY | O_DIRECTORY | O_CLOEXEC), rc = 0;

	if (folder < 0)
		return incise_error_set(err, errno, "%s: %s", recording, strerror(errno));
	if (flock(folder, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK)
		rc = incise_error_set(err, EBUSY,
				      "%s: another incise capture is writing it; sign it "
				      "when that has ended",
				      recording);
	close(folder);
	return rc;
}

bool seal_head(const char *path, char identity[33], struct incise_seal_head *head,
	       char why[200])
{
	struct incise_error err = {.text = ""};
	struct incise_recording *recording =
		cli_require(incise_recording_open(path, &err), &err);
	int rc = incise_seal_head(recording, identity, head, &err);
	size_t name = strlen(path);

	incise_recording_close(recording);
	if (rc && rc != -ENODATA)
		cli_fail_with(&err);
	snprintf(why, 200, "%.199s",
		 !strncmp(err.text, path, name) && !strncmp(err.text + name, ": ", 2)
			 ? err.text + name + 2
			 : err.text);
	return !rc;
}

char *seal_join(const char *path)
{
	struct incise_error err = {.text = ""};
	char *all = cli_text("%s:*", path), *text = NULL;
	struct incise_recording *recording = incise_recording_open(all, NULL);
	const struct incise_session_info *members;

	if (recording && incise_session_members(recording, &members))
		text = cli_require(incise_session_statement(recording, &err), &err);
	incise_recording_close(recording);
	free(all);
	return text;
}

size_t seal_statement_length(const char *text, size_t n)
{
	const char *end = memmem(text, n, "\nend\n", 5);

	return end ? (size_t)(end + 5 - text) : 0;
}

char *seal_calibrations(const char *recording, struct incise_error *err)
{
	struct incise_recalibration *list;
	int n = incise_recalibrations(recording, &list, err);
	char *text = NULL;
	size_t size;
	FILE *out = n < 0 ? NULL : open_memstream(&text, &size);

	if (n < 0)
		return NULL;
	if (!out)
		cli_fail("no memory");
	for (int i = 1; i < n; i++)
		fprintf(out, "calibration %s %s\n", list[i].file,
			*list[i].sha256 ? list[i].sha256 : "-");
	fclose(out);
	free(list);
	return text;
}

struct first {
	bool found;
	char text[300];
};

/* Keep the first finding that is no loss, which the recorder counted. */
static void find_first(void *user, const struct incise_verify_finding *finding)
{
	struct first *first = user;

	if (first->found || finding->kind == INCISE_VERIFY_LOST ||
	    finding->kind == INCISE_VERIFY_INTERRUPTED ||
	    finding->kind == INCISE_VERIFY_ENDED || finding->kind == INCISE_VERIFY_TIMES)
		return;
	first->found = true;
	snprintf(first->text, sizeof(first->text), "%s", finding->text);
}

static int check_all(const struct seal *seal, struct incise_error *err)
{
	struct first first = {.text = "see incise verify"};
	struct incise_verify_watch watch = {.found = find_first, .user = &first};
	struct incise_verify_report report;
	int rc = incise_seal_compare(seal->recording, seal->text,
				     seal_statement_length(seal->text, seal->n), &watch,
				     &report, err);

	if (rc || (report.intact && report.sealed))
		return rc;
	return incise_error_set(err, EBADMSG,
				"%s: not as it was recorded: %s; it is not signed",
				seal->recording, first.text);
}

/* Its number is that of a stored statement that says the same. Returns 0 or -errno. */
static int find_stored(struct seal *seal, struct incise_error *err)
{
	struct seal_files files;
	int rc = seal_files_read(&files, seal->recording, "seal", err);

	seal->number = 1;
	for (int i = 0; i < files.n && !rc && !seal->stored; i++) {
		struct seal_file *file = &files.all[i];

		if (file->number >= seal->number)
			seal->number = file->number + 1;
		if (file->kind != SEAL_STATEMENT || !file->bytes || file->n != seal->n ||
		    memcmp(file->bytes, seal->text, seal->n))
			continue;
		seal->number = file->number;
		seal->stored = true;
	}
	if (!rc && seal->number > NUMBER_MAX)
		rc = incise_error_set(err, E2BIG, "%s/seal: too many statements",
				      seal->recording);
	seal_files_free(&files);
	return rc;
}

/* Set text and statement. Returns 0 or -errno. */
static int make(struct seal *seal, struct incise_error *err)
{
	char *text = seal_join(seal->recording), *calibrations;

	if (text) {
		seal->joined = true;
		seal->text = text;
		seal->n = strlen(text);
		return 0;
	}
	text = incise_seal_statement(seal->recording, err);
	if (!text)
		return -errno;
	calibrations = seal_calibrations(seal->recording, err);
	if (!calibrations) {
		free(text);
		return -err->code;
	}
	seal->text = cli_text("%s%s", text, calibrations);
	seal->n = strlen(seal->text);
	free(text);
	free(calibrations);
	if (seal->n > STATEMENT_MAX)
		return incise_error_set(err, E2BIG, "%s: too many calibrations to sign",
					seal->recording);
	return incise_seal_read(&seal->statement, seal->text,
				seal_statement_length(seal->text, seal->n), err);
}

int seal_open(struct seal *seal, const char *recording, bool frames,
	      struct incise_error *err)
{
	int rc;

	memset(seal, 0, sizeof(*seal));
	seal->recording = cli_text("%s", recording);
	rc = check_idle(recording, err);
	if (!rc)
		rc = make(seal, err);
	if (!rc)
		rc = find_stored(seal, err);
	return rc || !frames || seal->joined ? rc : check_all(seal, err);
}

char *seal_extent(const struct seal *seal)
{
	if (seal->joined)
		return cli_text("the times of the join");
	return cli_text("%s, statement of commit %lld",
			seal->statement.complete ? "all of it"
						 : "up to where it was interrupted",
			(long long)seal->statement.last.commit);
}

void seal_close(struct seal *seal)
{
	free(seal->recording);
	free(seal->text);
}

/* --- writing ---------------------------------------------------------------------------- */

char *seal_statement_path(const struct seal *seal)
{
	return cli_text("%s/seal/%d%s", seal->recording, seal->number,
			kinds[SEAL_STATEMENT].extension);
}

char *seal_signature_path(const struct seal *seal, const struct signature *signature)
{
	char word[FINGERPRINT_CHARACTERS + 1] = "key";
	const char *fingerprint = strchr(signature->key, ':');

	if (fingerprint)
		snprintf(word, sizeof(word), "%s", fingerprint + 1);
	for (char *c = word; *c; c++)
		*c = *c == '/' ? '_' : isalnum((unsigned char)*c) ? *c : '-';
	return cli_text("%s/seal/%d.%s%s", seal->recording, seal->number, word,
			kinds[SEAL_SIGNATURE].extension);
}

char *seal_timestamp_path(const struct seal *seal, const struct timestamp *timestamp)
{
	char word[sizeof(timestamp->utc)], *to = word;

	for (const char *c = timestamp->utc; *c; c++)
		if (*c != '-' && *c != ':')
			*to++ = *c;
	*to = 0;
	return cli_text("%s/seal/%d.%s%s", seal->recording, seal->number, word,
			kinds[SEAL_TIMESTAMP].extension);
}

static int write_one(const char *path, const void *bytes, size_t n,
		     struct incise_error *err)
{
	struct incise_outfile *file;
	struct stat st;

	if (!lstat(path, &st) && !S_ISREG(st.st_mode))
		return incise_error_set(err, EEXIST, "%s: not a regular file; remove it",
					path);
	file = incise_outfile_open(path, err);
	if (!file)
		return -errno;
	fwrite(bytes, 1, n, incise_outfile_stream(file));
	return incise_outfile_commit(file, err);
}

int seal_write(struct seal *seal, const char *path, const void *bytes, size_t n,
	       struct incise_error *err)
{
	char *folder = cli_text("%s/seal", seal->recording);
	char *statement = seal_statement_path(seal);
	struct stat st;
	int rc = 0;

	if (mkdir(folder, 0777) && errno != EEXIST)
		rc = incise_error_set(err, errno, "%s: %s", folder, strerror(errno));
	else if (lstat(folder, &st) || !S_ISDIR(st.st_mode))
		rc = incise_error_set(err, ENOTDIR, "%s: not a folder; remove it",
				      folder);
	if (!rc && !seal->stored)
		rc = write_one(statement, seal->text, seal->n, err);
	if (!rc)
		seal->stored = true;
	if (!rc && path)
		rc = write_one(path, bytes, n, err);
	free(folder);
	free(statement);
	return rc;
}

char *seal_sign(const struct seal *seal, const char *key, struct signature *signature,
		struct incise_error *err)
{
	char *bytes = signature_make(key, seal->text, seal->n, err);

	if (bytes && !signature_check(signature, seal->text, seal->n, bytes,
				      strlen(bytes), NULL, -1, err)) {
		if (signature->verdict != SIGNATURE_WRONG)
			return bytes;
		incise_error_set(err, EIO,
				 "%s: ssh-keygen made a signature that it does "
				 "not accept: %s",
				 key, signature->why);
	}
	free(bytes);
	return NULL;
}
