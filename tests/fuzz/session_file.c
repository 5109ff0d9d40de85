// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The reader of sessions under libFuzzer. It takes a file or refuses it; one that it takes is within
 * its bounds, can be judged, and is the same once it is written and read again.
 *
 *   how 1
 *   how even: the rest is the file
 *   how odd:  member 2 of a good file, counted through it; the rest, as JSON, takes its place, or
 *             nothing where it is none
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../tools/cli/cli.h"
#include "../../tools/session/session.h"

/* tools/cli/json.c prints reports, too; here it prints none. */
void cli_fail(const char *fmt, ...)
{
	(void)fmt;
	abort();
}

void cli_finish(void)
{
	abort();
}

const char *cli_command_name(void)
{
	abort();
}

static json_t *good;

static void wrong(const char *what)
{
	fprintf(stderr, "session_file: %s\n", what);
	abort();
}

static char *dump(const json_t *json)
{
	char *text = json_dumps(json, JSON_REAL_PRECISION(15));

	if (!text)
		wrong("no text");
	return text;
}

/* A session with one of each. */
static void make_good(void)
{
	struct session *s = calloc(1, sizeof(*s));
	char *text;

	if (!s)
		wrong("no memory");
	strcpy(s->end.kind, "asked");
	strcpy(s->scene.crc32c, "0123abcd");
	strcpy(s->code, "P07");
	s->scene.rate_hz = 1000;
	s->has_membrane = true;
	s->membrane.normal[2] = 1;
	for (int i = 0; i < INCISE_CRITERIA; i++)
		s->criteria[i] = (struct incise_scene_criterion){true, 0, 1};
	s->n_phases = s->n_cuts = s->n_trace = 2;
	for (int i = 0; i < 2; i++) {
		s->phase[i].tool = INCISE_TOOL_BLADE;
		s->cut[i].incision = i;
		s->trace[i].t_s = i;
	}
	good = session_json(s);
	free(s);
	text = dump(good);
	s = session_parse(text, strlen(text), "good", NULL);
	if (!s)
		wrong("a good file is refused");
	free(s);
	free(text);
}

static void check_bounds(const struct session *s)
{
	struct session_verdict verdicts[INCISE_CRITERIA];
	char text[48];

	if (s->n_cuts < 0 || s->n_cuts > SESSION_CUTS_MAX || s->n_phases < 0 ||
	    s->n_phases > SESSION_PHASES_MAX || s->n_trace < 0 ||
	    s->n_trace > SESSION_TRACE_MAX)
		wrong("a list that is too long");
	if (!memchr(s->code, 0, sizeof(s->code)) ||
	    !memchr(s->scene.path, 0, sizeof(s->scene.path)) ||
	    !memchr(s->end.why, 0, sizeof(s->end.why)))
		wrong("a text without an end");
	session_judge(s, verdicts);
	for (int i = 0; i < INCISE_CRITERIA; i++) {
		if (isinf(verdicts[i].value) || (verdicts[i].met && !verdicts[i].judged))
			wrong("no verdict");
		session_criterion_value(i, verdicts[i].value, text, sizeof(text));
		session_criterion_asked(i, &s->criteria[i], text, sizeof(text));
	}
}

static void check_again(const struct session *s)
{
	json_t *json = session_json(s), *json_again;
	char *text = dump(json), *text_again;
	struct incise_error err = {0};
	struct session *again = session_parse(text, strlen(text), "again", &err);

	if (!again)
		wrong(err.text);
	json_again = session_json(again);
	text_again = dump(json_again);
	if (strcmp(text, text_again))
		wrong("another one when it is read again");
	json_decref(json);
	json_decref(json_again);
	free(text);
	free(text_again);
	free(again);
}

static void try_text(const char *text, size_t n)
{
	struct incise_error err = {0};
	struct session *s = session_parse(text, n, "input", &err);

	if (!s && (!err.code || !*err.text || strchr(err.text, '\n') ||
		   strncmp(err.text, "input", 5)))
		wrong("refused without a reason in one line");
	if (!s)
		return;
	check_bounds(s);
	check_again(s);
	free(s);
}

/* Replace the member that *left counts down to; NULL: take it away. */
static void replace(json_t *json, int *left, json_t *with)
{
	const char *key;
	json_t *value;
	size_t i;
	void *next;

	json_object_foreach_safe(json, next, key, value)
	{
		if (!(*left)--)
			with ? json_object_set(json, key, with)
			     : json_object_del(json, key);
		else
			replace(value, left, with);
		if (*left < 0)
			return;
	}
	for (i = 0; json_is_array(json) && i < json_array_size(json); i++) {
		if (!(*left)--)
			with ? json_array_set(json, i, with) : json_array_remove(json, i);
		else
			replace(json_array_get(json, i), left, with);
		if (*left < 0)
			return;
	}
}

static void try_member(const uint8_t *data, size_t size)
{
	int left = size < 2 ? 0 : data[0] | data[1] << 8;
	json_t *copy = json_deep_copy(good);
	json_t *with = size < 2 ? NULL
				: json_loadb((const char *)data + 2, size - 2,
					     JSON_DECODE_ANY, NULL);
	char *text;

	/* Members of the good file come round. */
	left %= 256;
	replace(copy, &left, with);
	text = dump(copy);
	try_text(text, strlen(text));
	free(text);
	json_decref(with);
	json_decref(copy);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	if (!good)
		make_good();
	if (!size)
		return 0;
	if (data[0] & 1)
		try_member(data + 1, size - 1);
	else
		try_text((const char *)data + 1, size - 1);
	return 0;
}
