// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The files that a file was made of; see origins.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/factor.h>
#include <incise/model.h>
#include <incise/recording.h>
#include <incise/session.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "origins.h"

#define BLOCK (1 << 20)
#define PNG_HEAD (8 + 25) /* signature and IHDR */
#define KEYWORD "incise-origin"

static bool same(const struct incise_origin *a, const struct incise_origin *b)
{
	return a->depth == b->depth && a->commit == b->commit &&
	       !strcmp(a->sha256, b->sha256) && !strcmp(a->kind, b->kind) &&
	       !strcmp(a->identity, b->identity) && !strcmp(a->name, b->name);
}

static void add(struct origins *origins, const struct incise_origin *origin)
{
	/* Said twice, for example in two parts of a file. */
	for (int i = 0; i < origins->n; i++)
		if (same(&origins->all[i], origin))
			return;
	if (origins->n == ORIGINS_MAX) {
		origins->cut = true;
		return;
	}
	if (!(origins->n & (origins->n - 1)))
		origins->all = cli_resize(origins->all,
					  (size_t)(origins->n ? 2 * origins->n : 1),
					  sizeof(*origins->all));
	origins->all[origins->n++] = *origin;
}

void origins_end(struct origins *origins)
{
	free(origins->all);
	*origins = (struct origins){0};
}

/* --- reading ---------------------------------------------------------------------------- */

/* Those that stand in the bytes of a file. */
static int read_tokens(struct origins *origins, const char *path,
		       struct incise_error *err)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY), code = 0;
	char *bytes = cli_alloc(BLOCK + INCISE_ORIGIN_TEXT, 1);
	struct incise_origin origin;
	size_t kept = 0, size, at;
	struct stat st;
	ssize_t n = 0;

	if (fd < 0 || fstat(fd, &st))
		code = errno;
	while (fd >= 0 && !code && S_ISREG(st.st_mode) && !origins->cut && !cli_stop) {
		n = read(fd, bytes + kept, BLOCK);
		if (n <= 0)
			break;
		size = kept + (size_t)n;
		at = 0;
		while (incise_origin_next(bytes, size, &at, &origin))
			add(origins, &origin);
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
static void add_source(struct origins *origins, const char *line)
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
			add(origins, &table);
		first = false;
		add(origins, &origin);
	}
	/* Without a token it is a table, or a recording of an older incise, which has more behind. */
	if (first && !strstr(name, ", recorded "))
		add(origins, &table);
}

int origins_read(struct origins *origins, const char *path, struct incise_error *err)
{
	char *notes, *save;

	if (file_kind_of(path) != FILE_MODEL)
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

/* --- adding ----------------------------------------------------------------------------- */

/* Of a format that has no head, and of one that cannot be read, there is nothing to say. */
static void add_recording(struct origins *origins, const char *path)
{
	char *whole = file_without_choice(path), *all = cli_text("%s:*", whole);
	struct incise_recording *recording = incise_recording_open(all, NULL);
	size_t size = INCISE_SESSION_MEMBERS_MAX * INCISE_ORIGIN_TEXT, at = 0, n = 0;
	char *text = cli_alloc(size, 1);
	struct incise_origin origin;

	/* Only a joined one opens with all its members. */
	if (!recording)
		recording = incise_recording_open(whole, NULL);
	if (recording)
		n = incise_recording_origins(recording, text, size);
	while (incise_origin_next(text, n, &at, &origin))
		add(origins, &origin);
	incise_recording_close(recording);
	free(text);
	free(all);
	free(whole);
}

static const char *kind_of(enum file_kind kind)
{
	static const struct {
		enum file_kind kind;
		const char *name;
	} names[] = {{FILE_MODEL, "model"},	    {FILE_COMPILED, "compiled"},
		     {FILE_TABLE, "table"},	    {FILE_SESSION, "session"},
		     {FILE_EXPORT, "export"},	    {FILE_IMAGE, "figure"},
		     {FILE_DEVIATION, "deviation"}, {FILE_CALIBRATION, "calibration"}};

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (names[i].kind == kind)
			return names[i].name;
	return "file";
}

static void add_file(struct origins *origins, const char *path, enum file_kind kind)
{
	struct origins below = {0};
	struct incise_error err = {0};
	struct incise_origin origin;
	struct stat st;

	/* A pipe was read by others, and is gone. */
	if (stat(path, &st) || !S_ISREG(st.st_mode))
		return;
	origin = (struct incise_origin){.depth = 1};
	strcpy(origin.kind, kind_of(kind));
	snprintf(origin.name, sizeof(origin.name), "%s", basename(path));
	if (incise_file_sha256(path, origin.sha256, &err) ||
	    origins_read(&below, path, &err))
		cli_fail_with(&err);
	add(origins, &origin);
	for (int i = 0; i < below.n; i++)
		if (++below.all[i].depth <= INCISE_ORIGIN_DEPTH_MAX)
			add(origins, &below.all[i]);
	origins->cut |= below.cut;
	origins_end(&below);
}

void origins_add(struct origins *origins, const char *path)
{
	/* An interrupted recording, and one that is named without its extension. */
	static const char *const ends[] = {"", ".part", ".rec"};

	for (int i = 0; i < 3; i++) {
		char *whole = cli_text("%s%s", path, ends[i]);
		bool is = file_kind_of(whole) == FILE_RECORDING;

		if (is)
			add_recording(origins, whole);
		free(whole);
		if (is)
			return;
	}
	add_file(origins, path, file_kind_of(path));
}

void origins_write(const struct origins *origins, FILE *out, const char *before,
		   const char *after)
{
	char text[INCISE_ORIGIN_TEXT];

	for (int i = 0; i < origins->n; i++)
		if (incise_origin_text(&origins->all[i], text) > 0)
			fprintf(out, "%s%s%s", before, text, after);
}

/*
 * --- figures ------------------------------------------------------------------------------
 *
 *   PNG:  signature, IHDR │ tEXt "incise-origin" NUL tokens │ the other chunks
 *   SVG:  … <svg …> │ <metadata>tokens</metadata> │ …
 *   PDF:  … %%EOF │ % tokens, startxref N, %%EOF, as readers seek the last ones in the last 1024 bytes
 */

static char *text_of(const struct origins *origins, const char *before, const char *after,
		     size_t *n)
{
	char *text = NULL;
	FILE *out = open_memstream(&text, n);

	if (!out)
		cli_fail("no memory");
	origins_write(origins, out, before, after);
	fclose(out);
	return text;
}

static void put_u32(FILE *out, uint32_t value)
{
	for (int shift = 24; shift >= 0; shift -= 8)
		putc((int)(value >> shift & 0xff), out);
}

/* CRC-32 as of PNG, continued from @crc. */
static uint32_t crc32_more(uint32_t crc, const char *bytes, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		crc ^= (unsigned char)bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
	}
	return crc;
}

static void put_chunk(const char *text, size_t n, FILE *out)
{
	static const char head[] = "tEXt" KEYWORD; /* with its NUL */
	uint32_t crc = crc32_more(~UINT32_C(0), head, sizeof(head));

	put_u32(out, (uint32_t)(sizeof(head) - 4 + n));
	fwrite(head, 1, sizeof(head), out);
	fwrite(text, 1, n, out);
	put_u32(out, ~crc32_more(crc, text, n));
}

/* Behind the start tag of the SVG; 0: there is none. */
static size_t inside_svg(const char *bytes, size_t n)
{
	const char *tag = memmem(bytes, n, "<svg", 4);
	const char *end = tag ? memchr(tag, '>', n - (size_t)(tag - bytes)) : NULL;

	return end ? (size_t)(end + 1 - bytes) : 0;
}

/* "startxref … %%EOF" at the end of a PDF; 0: there is none. */
static size_t last_reference(const char *bytes, size_t n)
{
	size_t from = n > 1024 ? n - 1024 : 0, found = 0;

	for (const char *at; (at = memmem(bytes + from, n - from, "startxref", 9));
	     from = found + 1)
		found = (size_t)(at - bytes);
	return found;
}

void origins_into_figure(const struct origins *origins, const char *bytes, size_t n,
			 FILE *out)
{
	bool png = n > PNG_HEAD && !memcmp(bytes, "\x89PNG\r\n\x1a\n", 8);
	bool pdf = n > 5 && !memcmp(bytes, "%PDF-", 5);
	size_t at = !origins->n ? n : png ? PNG_HEAD : pdf ? n : inside_svg(bytes, n);
	size_t reference = pdf ? last_reference(bytes, n) : 0, length;
	char *text;

	at = at ? at : n;
	fwrite(bytes, 1, at, out);
	if (origins->n && png) {
		text = text_of(origins, "", "\n", &length);
		put_chunk(text, length, out);
		free(text);
	} else if (origins->n && pdf && reference) {
		origins_write(origins, out, "% ", "\n");
		fwrite(bytes + reference, 1, n - reference, out);
	} else if (at < n) {
		fputs("\n<metadata>\n", out);
		origins_write(origins, out, "", "\n");
		fputs("</metadata>", out);
	}
	fwrite(bytes + at, 1, n - at, out);
}
