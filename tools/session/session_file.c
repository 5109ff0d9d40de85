// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * NAME.session, as incise-session(5) documents it: one JSON object. Tables of members serve writing
 * and reading; a file is another person's, and every member of it is checked.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include "../../lib/base/control_character.h"
#include "../cli/json.h"
#include "../cli/loop_report.h"
#include "session.h"

#define FILE_MOST (8 << 20) /* with a full trace it has 2 */
#define ROUND 1e4

static const struct incise_infile_kind session_kind = {
	.name = "a session",
	.advice = "give a file that incise haptic -o FILE.session wrote",
	.size_max = FILE_MOST,
};

enum kind {
	NUMBER,
	NULLABLE, /* a number, or null for NAN */
	COUNT,	  /* a whole number in a double */
	INDEX,	  /* the same in an int */
	VECTOR,	  /* three numbers */
	TEXT,
	FLAG,
	TOOL,
};

/* A member of an object; a table ends with {0}. */
struct member {
	const char *key;
	enum kind kind;
	size_t offset;
	double min, max; /* of a text: its bytes */
};

#define COUNT_MOST 9e15 /* a double holds every whole number up to here */
#define LENGTH(of, name)                                                          \
	{                                                                         \
#name, NUMBER, offsetof(struct of, name), 0, SESSION_PLACE_MAX_MM \
	}

#define MEMBER(key, kind, name, min, max)                           \
	{                                                           \
		key, kind, offsetof(struct session, name), min, max \
	}
#define TEXT_MEMBER(key, name) \
	MEMBER(key, TEXT, name, 0, sizeof(((struct session *)0)->name))
#define LENGTH_MEMBER(key, name) MEMBER(key, NUMBER, name, 0, SESSION_PLACE_MAX_MM)
#define FORCE_MEMBER(key, name) MEMBER(key, NUMBER, name, 0, SESSION_FORCE_MAX_N)
#define TIME_MEMBER(key, name) MEMBER(key, NULLABLE, name, 0, SESSION_TIME_MAX_S)
#define COUNT_MEMBER(key, name) MEMBER(key, COUNT, name, 0, COUNT_MOST)

static const struct member whole[] = {
	TEXT_MEMBER("version", version),
	TEXT_MEMBER("program", program),
	TEXT_MEMBER("source", source),
	TEXT_MEMBER("code", code),
	/* From 1970 to 2286, in figures that a double holds to 0.1 ms. */
	MEMBER("start_unix_s", NULLABLE, start_unix_s, 0, 1e10),
	COUNT_MEMBER("ticks", ticks),
	COUNT_MEMBER("ticks_lost", lost),
	COUNT_MEMBER("ticks_unusable", unusable),
	MEMBER("duration_s", NUMBER, duration_s, 0, SESSION_TIME_MAX_S),
	TIME_MEMBER("first_contact_s", first_s),
	TIME_MEMBER("last_contact_s", last_s),
	TIME_MEMBER("needed_s", needed_s),
	MEMBER("phases_apart_s", NUMBER, phases_apart_s, 0, SESSION_TIME_MAX_S),
	COUNT_MEMBER("phases_left_out", phases_left_out),
	MEMBER("cuts_full", FLAG, cuts_full, 0, 0),
	MEMBER("trace_s", NUMBER, trace_s, 0, SESSION_TIME_MAX_S),
	{0},
};

static const struct member end[] = {
	TEXT_MEMBER("kind", end.kind), TEXT_MEMBER("why", end.why), {0}};

static const struct member scene[] = {
	TEXT_MEMBER("path", scene.path),
	TEXT_MEMBER("crc32c", scene.crc32c),
	MEMBER("rate_hz", NUMBER, scene.rate_hz, 1, 1e6),
	{0},
};

static const struct member membrane[] = {
	MEMBER("point_mm", VECTOR, membrane.point_mm, -SESSION_PLACE_MAX_MM,
	       SESSION_PLACE_MAX_MM),
	MEMBER("normal", VECTOR, membrane.normal, -1, 1),
	LENGTH_MEMBER("radius_mm", membrane.radius_mm),
	LENGTH_MEMBER("thickness_mm", membrane.thickness_mm),
	FORCE_MEMBER("puncture_N", membrane.puncture_N),
	LENGTH_MEMBER("back_wall_mm", membrane.back_wall_mm),
	{0},
};

static const struct member enlarging[] = {
	FORCE_MEMBER("force_N", enlarging.force_N),
	LENGTH_MEMBER("open_mm", enlarging.open_mm),
	COUNT_MEMBER("turns", enlarging.turns),
	MEMBER("turned_deg", NUMBER, enlarging.turned_deg, 0, 90),
	MEMBER("time_s", NUMBER, enlarging.time_s, 0, SESSION_TIME_MAX_S),
	{0},
};

static const struct member insertion[] = {
	LENGTH_MEMBER("depth_mm", insertion.depth_mm),
	LENGTH_MEMBER("seated_mm", insertion.seated_mm),
	FORCE_MEMBER("force_N", insertion.force_N),
	TIME_MEMBER("placed_s", insertion.placed_s),
	{0},
};

static const struct member target[] = {
	MEMBER("hit", FLAG, target.hit, 0, 0),
	MEMBER("punctured", FLAG, target.punctured, 0, 0),
	MEMBER("tool", TOOL, target.tool, 0, 0),
	TIME_MEMBER("t_s", target.t_s),
	MEMBER("off_axis_mm", NULLABLE, target.off_axis_mm, 0, SESSION_PLACE_MAX_MM),
	COUNT_MEMBER("missed", target.missed),
	MEMBER("missed_mm", NULLABLE, target.missed_mm, 0, 2 * SESSION_PLACE_MAX_MM),
	{0},
};

static const struct member back_wall[] = {
	COUNT_MEMBER("touched", back_wall.touched),
	LENGTH_MEMBER("deepest_mm", back_wall.deepest_mm),
	{0},
};

static const struct member force[] = {
	FORCE_MEMBER("largest_N", force.largest_N),
	TIME_MEMBER("t_s", force.t_s),
	MEMBER("tool", TOOL, force.tool, 0, 0),
	{0},
};

static const struct {
	const char *key;
	const struct member *members;
} groups[] = {
	{"end", end},
	{"scene", scene},
	{"enlarging", enlarging},
	{"insertion", insertion},
	{"target", target},
	{"back_wall", back_wall},
	{"force", force},
};
#define GROUPS (sizeof(groups) / sizeof(*groups))

static const struct member phase[] = {
	{"tool", TOOL, offsetof(struct session_phase, tool), 0, 0},
	{"from_s", NUMBER, offsetof(struct session_phase, from_s), 0, SESSION_TIME_MAX_S},
	{"to_s", NUMBER, offsetof(struct session_phase, to_s), 0, SESSION_TIME_MAX_S},
	LENGTH(session_phase, depth_mm),
	{"force_N", NUMBER, offsetof(struct session_phase, force_N), 0,
	 SESSION_FORCE_MAX_N},
	{0},
};

static const struct member cut[] = {
	{"incision", INDEX, offsetof(struct session_cut, incision), 0,
	 SESSION_CUTS_MAX - 1},
	/* A cut goes on from a place within the limit. */
	{"from_mm", VECTOR, offsetof(struct session_cut, from_mm),
	 -2 * SESSION_PLACE_MAX_MM, 2 * SESSION_PLACE_MAX_MM},
	{"to_mm", VECTOR, offsetof(struct session_cut, to_mm), -2 * SESSION_PLACE_MAX_MM,
	 2 * SESSION_PLACE_MAX_MM},
	LENGTH(session_cut, length_mm),
	{"direction_deg", NUMBER, offsetof(struct session_cut, direction_deg), -90, 90},
	LENGTH(session_cut, depth_mm),
	LENGTH(session_cut, depth_median_mm),
	LENGTH(session_cut, open_mm),
	{"off_target_mm", NULLABLE, offsetof(struct session_cut, off_target_mm), 0,
	 4 * SESSION_PLACE_MAX_MM},
	{0},
};

/* A row of the trace is a list, in this order. */
static const struct member sample[] = {
	{"t_s", NUMBER, offsetof(struct session_sample, t_s), 0, SESSION_TIME_MAX_S},
	{"tool", INDEX, offsetof(struct session_sample, tool), 0, INCISE_TOOL_TUBE},
	{"x_mm", NUMBER, offsetof(struct session_sample, tool_mm[0]),
	 -SESSION_PLACE_MAX_MM, SESSION_PLACE_MAX_MM},
	{"y_mm", NUMBER, offsetof(struct session_sample, tool_mm[1]),
	 -SESSION_PLACE_MAX_MM, SESSION_PLACE_MAX_MM},
	{"z_mm", NUMBER, offsetof(struct session_sample, tool_mm[2]),
	 -SESSION_PLACE_MAX_MM, SESSION_PLACE_MAX_MM},
	LENGTH(session_sample, depth_mm),
	{"force_N", NUMBER, offsetof(struct session_sample, force_N), 0,
	 SESSION_FORCE_MAX_N},
	{0},
};

/* --- writing --------------------------------------------------------------------------- */

/* Without noise behind the digits that mean something, and without "-0.0". */
static json_t *rounded(double value)
{
	return json_number(round(value * ROUND) / ROUND + 0.0);
}

static json_t *vector(const double v[3])
{
	json_t *list = json_array();

	for (int i = 0; i < 3; i++)
		json_array_append_new(list, rounded(v[i]));
	return list;
}

static json_t *clean(const char *text)
{
	char *copy = strdup(text);
	json_t *json;

	for (char *c = copy; c && *c; c++)
		if (control_character(c))
			memset(c, '?', (size_t)control_character(c));
	json = copy ? json_text(copy) : NULL;
	free(copy);
	return json;
}

static json_t *put_member(const struct member *member, const void *object)
{
	const void *at = (const char *)object + member->offset;

	switch (member->kind) {
	case NUMBER:
	case NULLABLE:
		return rounded(*(const double *)at);
	case COUNT:
		return json_integer((json_int_t) * (const double *)at);
	case INDEX:
		return json_integer(*(const int *)at);
	case VECTOR:
		return vector(at);
	case TEXT:
		return clean(at);
	case FLAG:
		return json_boolean(*(const bool *)at);
	case TOOL:
		return json_string(loop_tool_names[*(const enum incise_tool *)at]);
	}
	return NULL;
}

static json_t *put_members(const struct member *members, const void *from, json_t *to)
{
	for (const struct member *member = members; member->key; member++)
		json_object_set_new(to, member->key, put_member(member, from));
	return to;
}

static json_t *put_objects(const struct member *members, const void *from, size_t size,
			   int n)
{
	json_t *list = json_array();

	for (int i = 0; i < n; i++)
		json_array_append_new(
			list, put_members(members, (const char *)from + (size_t)i * size,
					  json_object()));
	return list;
}

static json_t *put_criteria(const struct session *session)
{
	json_t *object = json_object();

	for (int i = 0; i < INCISE_CRITERIA; i++) {
		const struct incise_scene_criterion *criterion = &session->criteria[i];

		if (criterion->asked)
			json_object_set_new(object, incise_criterion_name(i),
					    json_pack("[o, o]", rounded(criterion->min),
						      rounded(criterion->max)));
	}
	return object;
}

static json_t *put_trace(const struct session *session)
{
	json_t *columns = json_array(), *rows = json_array();

	for (const struct member *member = sample; member->key; member++)
		json_array_append_new(columns, json_string(member->key));
	for (int i = 0; i < session->n_trace; i++) {
		json_t *row = json_array();

		for (const struct member *member = sample; member->key; member++)
			json_array_append_new(row,
					      put_member(member, &session->trace[i]));
		json_array_append_new(rows, row);
	}
	return json_pack("{so so}", "columns", columns, "rows", rows);
}

json_t *session_json(const struct session *session)
{
	json_t *object = json_pack("{so si}", "schema",
				   json_sprintf("incise/session/%d", SESSION_FORM),
				   "incise_session", SESSION_FORM);

	put_members(whole, session, object);
	for (size_t i = 0; i < GROUPS; i++)
		json_object_set_new(object, groups[i].key,
				    put_members(groups[i].members, session,
						json_object()));
	json_object_set_new(object, "membrane",
			    session->has_membrane
				    ? put_members(membrane, session, json_object())
				    : json_null());
	json_object_set_new(object, "criteria", put_criteria(session));
	json_object_set_new(object, "phases",
			    put_objects(phase, session->phase, sizeof(*session->phase),
					session->n_phases));
	json_object_set_new(object, "cuts",
			    put_objects(cut, session->cut, sizeof(*session->cut),
					session->n_cuts));
	json_object_set_new(object, "trace", put_trace(session));
	return object;
}

/* --- reading --------------------------------------------------------------------------- */

/* For messages: "NAME: cuts[3].length_mm: expected …". */
struct session_file_reader {
	const char *name;
	char place[40]; /* of the object: "", "end.", "cuts[3]." */
	struct incise_error *err;
};

static int expected(const struct session_file_reader *reader, const char *key,
		    const char *what)
{
	return incise_error_set(reader->err, EINVAL,
				"%s: %s%s: expected %s; the file is damaged, or not a "
				"session of incise",
				reader->name, reader->place, key, what);
}

static int take_number(const struct session_file_reader *reader,
		       const struct member *member, const json_t *json, double *value)
{
	bool whole_only = member->kind == COUNT || member->kind == INDEX;
	char what[80];

	*value = json_number_value(json);
	if ((whole_only ? json_is_integer(json) : json_is_number(json)) &&
	    *value >= member->min && *value <= member->max) {
		/* As it is written. */
		*value = whole_only ? *value : round(*value * ROUND) / ROUND + 0.0;
		return 0;
	}
	snprintf(what, sizeof(what), "a %s from %g to %g",
		 whole_only ? "whole number" : "number", member->min, member->max);
	return expected(reader, member->key, what);
}

static int take_vector(const struct session_file_reader *reader,
		       const struct member *member, const json_t *json, double *to)
{
	int rc = 0;

	if (!json_is_array(json) || json_array_size(json) != 3)
		return expected(reader, member->key, "three numbers");
	for (size_t i = 0; i < 3 && !rc; i++)
		rc = take_number(reader, member, json_array_get(json, i), &to[i]);
	return rc;
}

/* It is shown on terminals. */
static bool is_clean(const char *text, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (!text[i] || control_character(text + i))
			return false;
	return true;
}

static int take_session_file_text(const struct session_file_reader *reader,
				  const struct member *member, const json_t *json,
				  char *to)
{
	size_t n = json_string_length(json);
	char what[80];

	if (json_is_string(json) && n < (size_t)member->max &&
	    is_clean(json_string_value(json), n)) {
		memcpy(to, json_string_value(json), n + 1);
		return 0;
	}
	snprintf(what, sizeof(what),
		 "a text of at most %.0f bytes without control "
		 "characters",
		 member->max - 1);
	return expected(reader, member->key, what);
}

static int take_tool(const struct session_file_reader *reader,
		     const struct member *member, const json_t *json,
		     enum incise_tool *to)
{
	for (int i = 0; i <= INCISE_TOOL_TUBE && json_is_string(json); i++)
		if (!strcmp(json_string_value(json), loop_tool_names[i])) {
			*to = (enum incise_tool)i;
			return 0;
		}
	return expected(reader, member->key, "auto, blade, handle or tube");
}

static int take_member(const struct session_file_reader *reader,
		       const struct member *member, const json_t *json, void *object)
{
	void *at = (char *)object + member->offset;
	double value = NAN;
	int rc;

	switch (member->kind) {
	case NULLABLE:
		if (json_is_null(json)) {
			*(double *)at = NAN;
			return 0;
		}
		/* fall through */
	case NUMBER:
	case COUNT:
		return take_number(reader, member, json, at);
	case INDEX:
		rc = take_number(reader, member, json, &value);
		*(int *)at = rc ? 0 : (int)value;
		return rc;
	case VECTOR:
		return take_vector(reader, member, json, at);
	case TEXT:
		return take_session_file_text(reader, member, json, at);
	case FLAG:
		*(bool *)at = json_is_true(json);
		return json_is_boolean(json)
			       ? 0
			       : expected(reader, member->key, "true or false");
	case TOOL:
		return take_tool(reader, member, json, at);
	}
	return 0;
}

static int take_members(const struct session_file_reader *reader,
			const struct member *members, const json_t *json, void *object)
{
	int rc = 0;

	if (!json_is_object(json))
		return expected(reader, "", "an object");
	for (const struct member *member = members; member->key && !rc; member++)
		rc = take_member(reader, member, json_object_get(json, member->key),
				 object);
	return rc;
}

static int take_group(struct session_file_reader *reader, const char *key,
		      const struct member *members, const json_t *json,
		      struct session *session)
{
	snprintf(reader->place, sizeof(reader->place), "%s.", key);
	return take_members(reader, members, json_object_get(json, key), session);
}

/* At most @most objects of a list. */
static int take_objects(struct session_file_reader *reader, const char *key,
			const struct member *members, const json_t *json, void *to,
			size_t size, int most, int *n)
{
	const json_t *list = json_object_get(json, key);
	char what[40];
	int rc = 0;

	reader->place[0] = 0;
	if (!json_is_array(list) || json_array_size(list) > (size_t)most) {
		snprintf(what, sizeof(what), "a list of at most %d", most);
		return expected(reader, key, what);
	}
	*n = (int)json_array_size(list);
	for (int i = 0; i < *n && !rc; i++) {
		snprintf(reader->place, sizeof(reader->place), "%s[%d].", key, i);
		rc = take_members(reader, members, json_array_get(list, (size_t)i),
				  (char *)to + (size_t)i * size);
	}
	return rc;
}

static int take_criteria(struct session_file_reader *reader, const json_t *json,
			 struct session *session)
{
	const json_t *object = json_object_get(json, "criteria");
	int rc = 0;

	strcpy(reader->place, "criteria.");
	if (!json_is_object(object))
		return expected(reader, "", "an object");
	for (int i = 0; i < INCISE_CRITERIA && !rc; i++) {
		struct member member = {incise_criterion_name(i), NUMBER, 0, 0, 1e6};
		const json_t *ends = json_object_get(object, member.key);
		struct incise_scene_criterion *to = &session->criteria[i];

		to->asked = ends;
		if (!ends)
			continue;
		if (!json_is_array(ends) || json_array_size(ends) != 2)
			return expected(reader, member.key, "two numbers");
		rc = take_number(reader, &member, json_array_get(ends, 0), &to->min);
		if (!rc)
			rc = take_number(reader, &member, json_array_get(ends, 1),
					 &to->max);
		if (!rc && to->min > to->max)
			rc = expected(reader, member.key, "the smaller number first");
	}
	return rc;
}

static int take_session_file_row(struct session_file_reader *reader, const json_t *row,
				 struct session_sample *to)
{
	size_t i = 0;
	int rc = 0;

	if (!json_is_array(row))
		return expected(reader, "", "a list");
	for (const struct member *member = sample; member->key && !rc; member++)
		rc = take_member(reader, member, json_array_get(row, i++), to);
	return rc;
}

static int take_trace(struct session_file_reader *reader, const json_t *json,
		      struct session *session)
{
	const json_t *rows = json_object_get(json_object_get(json, "trace"), "rows");
	int rc = 0;

	strcpy(reader->place, "trace.");
	if (!json_is_array(rows) || json_array_size(rows) > SESSION_TRACE_MAX)
		return expected(reader, "rows", "a list that is not too long");
	session->n_trace = (int)json_array_size(rows);
	for (int i = 0; i < session->n_trace && !rc; i++) {
		snprintf(reader->place, sizeof(reader->place), "trace.rows[%d].", i);
		rc = take_session_file_row(reader, json_array_get(rows, (size_t)i),
					   &session->trace[i]);
		if (!rc && i && session->trace[i].t_s < session->trace[i - 1].t_s)
			rc = expected(reader, "t_s",
				      "a time that is not before the last");
	}
	return rc;
}

/* Checks beyond the tables' checks. */
static int check_session_file(struct session_file_reader *reader, struct session *session)
{
	reader->place[0] = 0;
	if (strspn(session->scene.crc32c, "0123456789abcdef") != 8)
		return expected(reader, "scene.crc32c", "eight hexadecimal digits");
	if (strcmp(session->end.kind, "asked") && strcmp(session->end.kind, "signal") &&
	    strcmp(session->end.kind, "fault"))
		return expected(reader, "end.kind", "asked, signal or fault");
	if (*session->code && !session_is_code(session->code))
		return expected(reader, "code", "letters, digits, - and _");
	if (session->has_membrane &&
	    fabs(session->membrane.normal[0] * session->membrane.normal[0] +
		 session->membrane.normal[1] * session->membrane.normal[1] +
		 session->membrane.normal[2] * session->membrane.normal[2] - 1) >
		    4 / ROUND)
		return expected(reader, "membrane.normal", "a unit vector");
	for (int i = 0; i < session->n_cuts; i++)
		if (session->cut[i].incision > i ||
		    session->cut[session->cut[i].incision].incision !=
			    session->cut[i].incision)
			return expected(reader, "cuts",
					"an incision whose first cut is there");
	return 0;
}

static int take_session(struct session_file_reader *reader, const json_t *json,
			struct session *session)
{
	const json_t *form = json_object_get(json, "incise_session");
	int rc;

	if (!json_is_object(json) || !json_is_integer(form))
		return expected(reader, "incise_session", "the number of its form");
	if (json_integer_value(form) != SESSION_FORM)
		return incise_error_set(reader->err, EPROTO,
					"%s: form %lld, but this program reads form "
					"%d; use the version of incise that wrote it",
					reader->name, (long long)json_integer_value(form),
					SESSION_FORM);
	rc = take_members(reader, whole, json, session);
	for (size_t i = 0; i < GROUPS && !rc; i++)
		rc = take_group(reader, groups[i].key, groups[i].members, json, session);
	session->has_membrane = !json_is_null(json_object_get(json, "membrane"));
	if (!rc && session->has_membrane)
		rc = take_group(reader, "membrane", membrane, json, session);
	if (!rc)
		rc = take_criteria(reader, json, session);
	if (!rc)
		rc = take_objects(reader, "phases", phase, json, session->phase,
				  sizeof(*session->phase), SESSION_PHASES_MAX,
				  &session->n_phases);
	if (!rc)
		rc = take_objects(reader, "cuts", cut, json, session->cut,
				  sizeof(*session->cut), SESSION_CUTS_MAX,
				  &session->n_cuts);
	if (!rc)
		rc = take_trace(reader, json, session);
	return rc ? rc : check_session_file(reader, session);
}

struct session *session_parse(const char *text, size_t n, const char *name,
			      struct incise_error *err)
{
	struct session_file_reader reader = {.name = name, .err = err};
	json_t *json = json_parse(text, n, name, err);
	struct session *session = json ? calloc(1, sizeof(*session)) : NULL;
	int rc = session ? take_session(&reader, json, session) : -EINVAL;

	if (json && !session)
		rc = incise_error_set(err, ENOMEM, "%s: out of memory", name);
	json_decref(json);
	if (!rc)
		return session;
	free(session);
	errno = -rc;
	return NULL;
}

struct session *session_read(const char *path, struct incise_error *err)
{
	size_t n;
	char *text = incise_infile_read(path, &session_kind, &n, err);
	struct session *session = text ? session_parse(text, n, path, err) : NULL;

	free(text);
	return session;
}
