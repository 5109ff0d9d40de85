// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The files that a file was made of, as it says itself; see incise/origin.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/model.h>
#include <incise/origin.h>
#include <incise/recalibration.h>
#include <incise/recording.h>
#include <incise/seal.h>
#include <incise/session.h>
#include "../read/recalibration.h"
#include "../read/recording.h"
#include "../read/session.h"
#include "prove.h"

#define BLOCK (1 << 20)

static bool is_same(const struct incise_origin *a, const struct incise_origin *b)
{
	return a->depth == b->depth && a->commit == b->commit &&
	       !strcmp(a->sha256, b->sha256) && !strcmp(a->kind, b->kind) &&
	       !strcmp(a->identity, b->identity) && !strcmp(a->name, b->name);
}

static void add_origin(struct incise_origins *origins, const struct incise_origin *origin)
{
	struct incise_origin *all = origins->all;
	size_t n = (size_t)origins->n;

	/* Said twice, for example in two parts of a file. */
	for (size_t i = 0; i < n; i++)
		if (is_same(&all[i], origin))
			return;
	if (n < INCISE_ORIGINS_MAX && !(n & (n - 1)))
		all = reallocarray(all, n ? 2 * n : 1, sizeof(*all));
	if (n == INCISE_ORIGINS_MAX || !all) {
		origins->cut = true;
		return;
	}
	origins->all = all;
	origins->all[origins->n++] = *origin;
}

void incise_origins_free(struct incise_origins *origins)
{
	free(origins->all);
	*origins = (struct incise_origins){0};
}

/* --- reading ---------------------------------------------------------------------------- */

/* Read the origins that stand in the bytes of a file. */
static int read_tokens(struct incise_origins *origins, const char *path,
		       struct incise_error *err)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY), code = 0;
	char *bytes = malloc(BLOCK + INCISE_ORIGIN_TEXT);
	struct incise_origin origin;
	size_t kept = 0, size, at;
	struct stat st;
	ssize_t n = 0;

	if (fd < 0 || fstat(fd, &st))
		code = errno;
	else if (!bytes)
		code = ENOMEM;
	while (fd >= 0 && !code && S_ISREG(st.st_mode) && !origins->cut) {
		n = read(fd, bytes + kept, BLOCK);
		if (n <= 0)
			break;
		size = kept + (size_t)n;
		at = 0;
		while (incise_origin_next(bytes, size, &at, &origin))
			add_origin(origins, &origin);
		/* A token at the end may go on in the next block. */
		kept = size < INCISE_ORIGIN_TEXT ? size : INCISE_ORIGIN_TEXT;
		memmove(bytes, bytes + size - kept, kept);
	}
	if (n < 0)
		code = errno;
	if (fd >= 0)
		close(fd);
	free(bytes);
	return code ? incise_error_set(err, code, "%s: %s", path, strerror(code)) : 0;
}

/*
 * A source in the notes of a model, "source: SHA256 120 pairs, NAME" and perhaps ", incise:2:…" behind
 * it: a table, with its origins. A recording is named by the token behind its name alone.
 */
static void add_source(struct incise_origins *origins, const char *line)
{
	struct incise_origin table = {.depth = 1, .kind = "table"}, origin;
	const char *name = strstr(line, " pairs, "), *end = strstr(line, ", incise:");
	size_t at = 0, n = strlen(line);
	bool first = true;

	if (strspn(line, "0123456789abcdef") != 64 || !name || (end && end < name))
		return;
	name += 8;
	snprintf(table.sha256, sizeof(table.sha256), "%.64s", line);
	snprintf(table.name, sizeof(table.name), "%.*s",
		 (int)(end ? end - name : (long)strlen(name)), name);
	while (incise_origin_next(line, n, &at, &origin)) {
		if (first && origin.depth > 1)
			add_origin(origins, &table);
		first = false;
		add_origin(origins, &origin);
	}
	/* Without a token it is a table, or a recording of an older incise, which has more behind. */
	if (first && !strstr(name, ", recorded "))
		add_origin(origins, &table);
}

int incise_origins_read(struct incise_origins *origins, const char *path, bool model,
			struct incise_error *err)
{
	char *notes, *save;

	if (!model)
		return read_tokens(origins, path, err);
	notes = incise_model_notes(path, err);
	if (!notes)
		return -errno;
	for (char *line = strtok_r(notes, "\n", &save); line;
	     line = strtok_r(NULL, "\n", &save))
		if (!strncmp(line, "source: ", 8))
			add_source(origins, line + 8);
	free(notes);
	return 0;
}

/* --- of a recording --------------------------------------------------------------------- */

size_t incise_origin_put(const struct incise_origin *origin, char *text, size_t size,
			 size_t at)
{
	char token[INCISE_ORIGIN_TEXT];

	if (incise_origin_text(origin, token) <= 0 ||
	    at + (at > 0) + strlen(token) >= size)
		return at;
	return at + (size_t)sprintf(text + at, "%s%s", at ? " " : "", token);
}

/*
 * Append the head of a recording, and the calibration by which it is read, if it is not that of its
 * capture. Nothing of one that has no head.
 */
static size_t put_origin(struct incise_recording *recording, const char *name, char *text,
			 size_t size, size_t at)
{
	struct incise_origin origin = {.depth = 1, .kind = "recording"},
			     calibration = {.depth = 2, .kind = "calibration"};
	struct incise_seal_head head;

	if (incise_seal_head(recording, origin.identity, &head, NULL))
		return at;
	strcpy(origin.sha256, head.head);
	origin.commit = (uint64_t)head.commit;
	snprintf(origin.name, sizeof(origin.name), "%s", name);
	at = incise_origin_put(&origin, text, size, at);
	if (!recording->recalibrated)
		return at;
	memcpy(calibration.sha256, recording->recalibrated->entry.sha256,
	       sizeof(calibration.sha256));
	snprintf(calibration.name, sizeof(calibration.name), "%s",
		 basename(recording->recalibrated->entry.file));
	return incise_origin_put(&calibration, text, size, at);
}

size_t incise_recording_origins(struct incise_recording *recording, char *text,
				size_t size)
{
	const struct incise_session *session = recording->session;
	const char *whole = basename(recording->path);
	char name[512];
	size_t at = 0;

	*text = 0;
	if (!session)
		return put_origin(recording, whole, text, size, 0);
	for (int i = 0; i < session->n; i++) {
		snprintf(name, sizeof(name), "%s:%s", whole, session->info[i].name);
		at = put_origin(session->members[i], name, text, size, at);
	}
	return at;
}

/* --- adding ----------------------------------------------------------------------------- */

static int add_recording(struct incise_origins *origins, const char *path,
			 struct incise_error *err)
{
	size_t size = INCISE_SESSION_MEMBERS_MAX * INCISE_ORIGIN_TEXT, at = 0, n = 0;
	char *folder = incise_proof_folder(path, err), *all = NULL, *text = malloc(size);
	struct incise_recording *recording = NULL;
	struct incise_origin origin;
	int rc = folder ? 0 : -errno;

	/* Only a joined one opens with all its members. */
	if (folder && asprintf(&all, "%s:*", folder) >= 0)
		recording = incise_recording_open(all, NULL);
	if (folder && !recording)
		recording = incise_recording_open(folder, NULL);
	if (recording && text)
		n = incise_recording_origins(recording, text, size);
	while (incise_origin_next(text, n, &at, &origin))
		add_origin(origins, &origin);
	incise_recording_close(recording);
	free(text);
	free(all);
	free(folder);
	return rc;
}

int incise_origins_add(struct incise_origins *origins, const char *path, const char *kind,
		       struct incise_error *err)
{
	struct incise_origins below = {0};
	struct incise_origin origin = {.depth = 1};
	struct stat st;
	int rc;

	if (!strcmp(kind, "recording"))
		return add_recording(origins, path, err);
	/* A pipe was read by others, and is gone. */
	if (stat(path, &st) || !S_ISREG(st.st_mode))
		return 0;
	snprintf(origin.kind, sizeof(origin.kind), "%s", kind);
	snprintf(origin.name, sizeof(origin.name), "%s", basename(path));
	rc = incise_sha256_file(path, origin.sha256, NULL, NULL, err);
	if (!rc)
		rc = incise_origins_read(&below, path, !strcmp(kind, "model"), err);
	if (!rc)
		add_origin(origins, &origin);
	for (int i = 0; i < below.n && !rc; i++)
		if (++below.all[i].depth <= INCISE_ORIGIN_DEPTH_MAX)
			add_origin(origins, &below.all[i]);
	origins->cut |= below.cut;
	incise_origins_free(&below);
	return rc;
}

/* --- describing ------------------------------------------------------------------------- */

#define ORIGINS_MOST 480 /* bytes of a recording's origins in its text */

static int name_length(const char *path, const char **name)
{
	size_t end = strlen(path), begin;

	while (end > 1 && path[end - 1] == '/')
		end--;
	for (begin = end; begin && path[begin - 1] != '/';)
		begin--;
	*name = path + begin;
	return (int)(end - begin);
}

static int describe_recording(const char *name, int length,
			      struct incise_recording *recording, char *text,
			      struct incise_error *err)
{
	struct incise_recalibration active;
	struct incise_recording_info info;
	char origins[ORIGINS_MOST];
	int rc = incise_recording_info(recording, &info, err);

	if (rc)
		return rc;
	incise_recording_recalibration(recording, &active);
	incise_recording_origins(recording, origins, sizeof(origins));
	snprintf(text, INCISE_SOURCE_TEXT,
		 "%.*s, %s%srecorded %s, rig %.*s, force %.9g mV/N, zero %.9g mV, camera "
		 "%.9g mm/px%s%s%s%s",
		 length < 100 ? length : 100, name, origins, *origins ? ", " : "",
		 info.started, *active.file ? 40 : 120, info.rig, info.force_mV_N,
		 info.zero_mV, info.depth_mm_px, *active.file ? ", by " : "", active.file,
		 *active.file ? ", SHA-256 " : "", active.sha256);
	return 0;
}

int incise_source_text(const char *path, struct incise_recording *recording, char *text,
		       struct incise_error *err)
{
	struct incise_origins origins = {0};
	char token[INCISE_ORIGIN_TEXT];
	const char *name;
	int length = name_length(path, &name), rc;
	size_t at;

	if (recording)
		return describe_recording(name, length, recording, text, err);
	at = (size_t)snprintf(text, INCISE_SOURCE_TEXT, "%.*s",
			      length < 300 ? length : 300, name);
	rc = incise_origins_read(&origins, path, false, err);
	for (int i = 0; i < origins.n; i++) {
		origins.all[i].depth++;
		if (incise_origin_text(&origins.all[i], token) <= 0)
			continue;
		if (at + strlen(token) + 2 >= INCISE_SOURCE_TEXT)
			break;
		at += (size_t)sprintf(text + at, "%s%s", i ? " " : ", ", token);
	}
	incise_origins_free(&origins);
	return rc;
}
