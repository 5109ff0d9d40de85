// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A file of any kind in the viewer, and the page around it; see web.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/version.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "../cli/json.h"
#include "web.h"

/* --- kinds ----------------------------------------------------------------------------- */

struct web_file *web_open(const char *path)
{
	switch (file_kind_of(path)) {
	case FILE_SESSION:
		return web_session_open(path);
	case FILE_MODEL:
		return web_model_open(path);
	default: /* an interrupted one opens under its name as well */
		return web_recording_open(path);
	}
}

int web_read(struct web_file *file, int spans, const volatile sig_atomic_t *stop,
	     struct incise_error *err)
{
	return file->kind->read ? file->kind->read(file, spans, stop, err) : 0;
}

double web_done(struct web_file *file)
{
	return file->kind->done ? file->kind->done(file) : 1;
}

json_t *web_head(struct web_file *file)
{
	return file->kind->head(file);
}

int web_part(struct web_file *file, double from, double to, int columns, FILE *out,
	     struct incise_error *err)
{
	if (!(from < to) || !isfinite(to - from) || columns < 1)
		return incise_error_set(err, EINVAL,
					"a part needs from < to and 1 column or more");
	return file->kind->part(file, from, to, columns, out, err);
}

int web_frame(struct web_file *file, double *t_s, struct pixels *pixels,
	      struct incise_error *err)
{
	/* Within what int64_t holds in ns. */
	if (!(fabs(*t_s) < 9e9) || !file->kind->frame)
		return incise_error_set(err, ENODATA, "no frame at that time");
	return file->kind->frame(file, t_s, pixels, err);
}

void web_close(struct web_file *file)
{
	if (file)
		file->kind->close(file);
}

/* --- heads ----------------------------------------------------------------------------- */

json_t *web_head_new(const char *kind, const char *path, const char *axis,
		     const char *unit, double from, double to)
{
	return json_pack("{ss so ss s{ss ss} sf sf s[] s[] s[] s[] sn}", "kind", kind,
			 "title", json_text(path), "version", INCISE_VERSION, "axis",
			 "label", axis, "unit", unit, "from", from, "to", to, "panels",
			 "tracks", "cuts", "events", "frames");
}

void web_head_panel(json_t *head, const char *label, const char *unit, const char *labels)
{
	json_t *tracks = json_object_get(head, "tracks"), *own = json_array();

	while (*labels) {
		size_t n = strcspn(labels, "|");

		json_array_append_new(own,
				      json_integer((json_int_t)json_array_size(tracks)));
		json_array_append_new(tracks, json_pack("{so}", "label",
							json_stringn(labels, n)));
		labels += n + (labels[n] == '|');
	}
	if (label)
		json_array_append_new(json_object_get(head, "panels"),
				      json_pack("{ss ss sO}", "label", label, "unit",
						unit, "tracks", own));
	json_decref(own);
}

/* --- pixels ---------------------------------------------------------------------------- */

void web_reduce(struct pixels *pixels)
{
	int step = (pixels->width + WEB_FRAME_WIDTH - 1) / WEB_FRAME_WIDTH;
	int width = pixels->width / step, height = pixels->height / step;
	size_t n = (size_t)pixels->components;
	uint8_t *to = pixels->bytes;

	if (step < 2 || height < 1)
		return;
	for (int y = 0; y < height; y++)
		for (int x = 0; x < width; x++, to += n)
			memcpy(to,
			       pixels->bytes + n * ((size_t)y * step * pixels->width +
						    (size_t)x * step),
			       n);
	pixels->width = width;
	pixels->height = height;
}

/* --- the page -------------------------------------------------------------------------- */

#define PAGE_SPANS 16000
#define PAGE_FRAMES 60

extern const char text_viewer_html[], text_viewer_css[], text_viewer_js[];

/* JSON within a page: no text ends its element. */
static void put_json(FILE *out, const char *text)
{
	for (; text && *text; text++)
		if (*text == '<')
			fputs("\\u003c", out);
		else
			fputc(*text, out);
}

static void put_base64(FILE *out, const uint8_t *bytes, size_t n)
{
	static const char letters[] =
		"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

	for (size_t i = 0; i < n; i += 3) {
		uint32_t word = (uint32_t)bytes[i] << 16 |
				(i + 1 < n ? (uint32_t)bytes[i + 1] << 8 : 0) |
				(i + 2 < n ? bytes[i + 2] : 0);

		for (int k = 0; k < 4; k++)
			fputc(i + (size_t)k > n ? '='
						: letters[word >> (18 - 6 * k) & 63],
			      out);
	}
}

/* Some frames of all, evenly apart; without libjpeg none. */
static void put_frames(struct web_file *file, double from, double to, FILE *out)
{
	struct pixels pixels = {0};
	double last_s = -INFINITY;
	bool first = true;

	for (int i = 0; i < PAGE_FRAMES; i++) {
		double t_s = from + (to - from) * (i + 0.5) / PAGE_FRAMES;
		uint8_t *jpeg;
		size_t n;

		if (web_frame(file, &t_s, &pixels, NULL))
			break;
		if (t_s <= last_s || !(jpeg = pixels_jpeg(&pixels, &n)))
			continue;
		fprintf(out, "%s[%.6f,\"data:image/jpeg;base64,", first ? "" : ",", t_s);
		put_base64(out, jpeg, n);
		fputs("\"]", out);
		free(jpeg);
		first = false;
		last_s = t_s;
	}
	free(pixels.bytes);
}

/* The document: all that the page holds in place of a server. */
static int put_document(struct web_file *file, FILE *out, struct incise_error *err)
{
	json_t *head;
	double from, to;
	char *text, *part = NULL;
	size_t size;
	FILE *memory;
	int rc = web_read(file, PAGE_SPANS, &cli_stop, err);

	if (rc)
		return rc;
	head = web_head(file);
	from = json_number_value(json_object_get(head, "from"));
	to = json_number_value(json_object_get(head, "to"));
	if (file->kind->read)
		json_object_set_new(
			head, "note",
			json_taken(
				cli_text("reduced to columns of %.3g ms, of which the "
					 "least and the largest value are kept; 'incise "
					 "serve %s --http 8080' shows all",
					 (to - from) / PAGE_SPANS * 1e3, file->path)));
	text = json_dumps(head, JSON_COMPACT | JSON_REAL_PRECISION(10));
	json_decref(head);
	memory = open_memstream(&part, &size);
	if (!memory || !text)
		return incise_error_set(err, ENOMEM, "%s: out of memory", file->path);
	rc = web_part(file, from, to, PAGE_SPANS, memory, err);
	fclose(memory);
	fputs("{\"head\":", out);
	put_json(out, text);
	fputs(",\"part\":", out);
	put_json(out, part);
	fputs(",\"frames\":[", out);
	put_frames(file, from, to, out);
	fputs("]}", out);
	free(text);
	free(part);
	return rc;
}

/* The text up to a mark; returns what is behind it. */
static const char *put_until(FILE *out, const char *text, const char *mark)
{
	const char *at = strstr(text, mark);

	fwrite(text, 1, (size_t)(at - text), out);
	return at + strlen(mark);
}

char *web_page(struct web_file *file, size_t *size, struct incise_error *err)
{
	const char *rest = text_viewer_html;
	char *page = NULL;
	FILE *out = open_memstream(&page, size);
	int rc = 0;

	if (!out)
		return INCISE_ERROR_NULL(err, ENOMEM, "out of memory");
	rest = put_until(out, rest, "/*STYLE*/");
	fputs(text_viewer_css, out);
	rest = put_until(out, rest, "/*DOCUMENT*/");
	if (file)
		rc = put_document(file, out, err);
	rest = put_until(out, rest, "/*SCRIPT*/");
	fputs(text_viewer_js, out);
	fputs(rest, out);
	if (!fclose(out) && !rc)
		return page;
	free(page);
	return NULL;
}
