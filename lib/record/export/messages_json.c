// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Messages in JSON with JSON Schemas, in the project's units; see messages.h.
 */
#include <math.h>
#include <string.h>
#include "../../base/utf8.h"
#include "decimal.h"
#include "messages.h"

#define NUMBER(about) "{\"type\":\"number\",\"description\":\"" about "\"}"
#define OBJECT(properties) "{\"type\":\"object\",\"properties\":{" properties "}}"

static char *add(char *to, const char *text)
{
	return stpcpy(to, text);
}

static char *add_real(char *to, const char *before, double value, int decimals)
{
	return incise_decimal_real(add(to, before), value, decimals);
}

/* Uncertainties of a quantity, as further members. */
static char *add_uncertainties(char *to, const struct incise_messages *messages,
			       enum incise_budget_quantity quantity,
			       const double part[INCISE_BUDGET_PARTS])
{
	const struct incise_budget_value *value = &incise_budget_values()[quantity];
	int n = messages->uncertainty == INCISE_EXPORT_PARTS ? value->n : 0;

	for (int i = -1; i < n; i++) {
		double u = i < 0 ? incise_budget_total(quantity, part)
				 : part[value->first + i];

		to = add(to, ",\"");
		to = add(to, i < 0 ? value->total
				   : incise_budget_parts()[value->first + i].column);
		to = add(to, "\":");
		/* JSON has no NaN. */
		to = isfinite(u) ? incise_decimal_real(to, u, 7) : add(to, "null");
	}
	return to;
}

static int64_t force_message(struct incise_messages *messages,
			     const struct incise_rows *rows)
{
	char *to = messages->text;
	double force_N;
	bool clipped;
	int64_t code = incise_message_force(messages, rows, &force_N, &clipped);

	if (code < 0)
		return code;
	to = add_real(to, "{\"force_N\":", force_N, 5);
	to = incise_decimal_integer(add(to, ",\"code\":"), code);
	to = add(to, clipped ? ",\"clipped\":true" : ",\"clipped\":false");
	if (messages->budget) {
		double part[INCISE_BUDGET_PARTS];

		incise_budget_row(messages->budget,
				  &(struct incise_budget_row){.force_N = force_N,
							      .force_share = 1},
				  part);
		to = add_uncertainties(to, messages, INCISE_BUDGET_FORCE, part);
	}
	return add(to, "}") - messages->text;
}

/* A text in JSON's quotes; bytes that are not UTF-8 become '?'. */
static char *add_text(char *to, const char *before, const char *text)
{
	to = add(to, before);
	*to++ = '"';
	while (*text) {
		int length = utf8_printable(text);

		if (*text == '"' || *text == '\\')
			*to++ = '\\';
		*to++ = length ? *text : '?';
		text++;
		for (int i = 1; i < length; i++)
			*to++ = *text++;
	}
	*to++ = '"';
	return to;
}

static int64_t tracker_message(struct incise_messages *messages,
			       const struct incise_rows *rows)
{
	static const char *const before[] = {"{\"position_mm\":{\"x\":",
					     ",\"y\":",
					     ",\"z\":",
					     "},\"orientation\":{\"w\":",
					     ",\"x\":",
					     ",\"y\":",
					     ",\"z\":"};
	const char status[] = {incise_rows_char(rows, 9), 0};
	char *to = messages->text;

	for (int i = 0; i < 7; i++)
		to = add_real(to, before[i], incise_rows_real(rows, 2 + i),
			      i < 3 ? 4 : 6);
	to = add_text(to, "},\"status\":", status);
	return add(to, "}") - messages->text;
}

static int64_t depth_message(struct incise_messages *messages,
			     const struct incise_rows *rows)
{
	char *to = messages->text;

	to = add_real(to, "{\"depth_mm\":", incise_rows_real(rows, 2), 4);
	to = add_real(to, ",\"velocity_mm_s\":", incise_rows_real(rows, 3), 3);
	if (messages->budget) {
		struct incise_budget_row row = {.tracker_time = true};
		struct incise_blade_pose_value value;
		double part[INCISE_BUDGET_PARTS];
		int rc = incise_blade_pose_at(&messages->blade, rows->t_ns, 0, &value,
					      NULL);

		if (rc)
			return rc;
		incise_blade_pose_budget(&messages->blade, rows->t_ns, &value, &row);
		incise_budget_row(messages->budget, &row, part);
		to = add_uncertainties(to, messages, INCISE_BUDGET_DEPTH, part);
		to = add_uncertainties(to, messages, INCISE_BUDGET_VELOCITY, part);
	}
	return add(to, "}") - messages->text;
}

static int64_t event_message(struct incise_messages *messages,
			     const struct incise_rows *rows)
{
	size_t kind_bytes, text_bytes;
	const char *kind = incise_rows_text(rows, 2, &kind_bytes);
	const char *text = incise_rows_text(rows, 3, &text_bytes);
	int rc = incise_messages_reserve(messages, kind_bytes + text_bytes);
	char *to = messages->text;

	if (rc)
		return rc;
	to = add_text(to, "{\"kind\":", kind);
	to = add_text(to, ",\"text\":", text);
	return add(to, "}") - messages->text;
}

static const struct incise_message_stream streams[] = {
	{"force", "seq, t_ns, code", force_message, "/force", "incise.Force",
	 OBJECT("\"force_N\":" NUMBER("N") ",\"code\":{\"type\":\"integer\"},"
					   "\"clipped\":{\"type\":\"boolean\"}")},
	{"tracker", "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status",
	 tracker_message, "/tracker", "incise.Pose",
	 OBJECT("\"position_mm\":" OBJECT("\"x\":" NUMBER("mm") ",\"y\":" NUMBER("mm") ",\"z\":" NUMBER("mm")) ",\"orientation\":" OBJECT(
		 "\"w\":" NUMBER("unit quaternion") ",\"x\":" NUMBER("unit quaternion") ",\"y\":" NUMBER(
			 "unit quaternion") ",\"z\":" NUMBER("unit quaternion")) ",\"status\":{\"type\":\"string\"}")},
	{"depth", "seq, t_ns, depth_mm, velocity_mm_s", depth_message, "/depth",
	 "incise.Depth",
	 OBJECT("\"depth_mm\":" NUMBER("mm") ",\"velocity_mm_s\":" NUMBER("mm/s"))},
	{"events", "rowid, t_ns, kind, text", event_message, "/events", "incise.Event",
	 OBJECT("\"kind\":{\"type\":\"string\"},\"text\":{\"type\":\"string\"}")},
};

const struct incise_message_profile incise_messages_json = {
	.name = "",
	.encoding = "json",
	.schema_encoding = "jsonschema",
	.streams = streams,
	.n = sizeof(streams) / sizeof(*streams),
};
