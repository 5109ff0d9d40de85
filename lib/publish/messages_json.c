// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Messages in JSON with JSON Schemas, in the project's units; see messages.h.
 */
#include <math.h>
#include <string.h>
#include "../base/utf8.h"
#include "decimal.h"
#include "messages.h"

#define NUMBER(about) "{\"type\":\"number\",\"description\":\"" about "\"}"
#define OBJECT(properties) "{\"type\":\"object\",\"properties\":{" properties "}}"

/* A member of a message: what stands before its value, and the cell of that. */
struct incise_json_member {
	const char *before; /* NULL: the end */
	int cell;
};

static char *add_messages_json(char *to, const char *text)
{
	return stpcpy(to, text);
}

/* A value as its column says. */
static char *add_value(char *to, const struct incise_table_column *column,
		       const union incise_cell *cell)
{
	switch (column->type) {
	case INCISE_COLUMN_REAL:
		return incise_decimal_real(to, cell->real, column->decimals);
	case INCISE_COLUMN_FLAG:
		return add_messages_json(to, cell->flag ? "true" : "false");
	case INCISE_COLUMN_TEXT:
		return add_messages_json(utf8_copy_printable(add_messages_json(to, "\""),
							     cell->text, "\"\\"),
					 "\"");
	default:
		return incise_decimal_integer(to, cell->integer);
	}
}

/* Uncertainties of a quantity, as further members. */
static char *add_uncertainties(char *to, const struct incise_messages *messages,
			       enum incise_budget_quantity quantity,
			       const double part[INCISE_BUDGET_PARTS])
{
	const struct incise_budget_value *value = &incise_budget_values()[quantity];
	int n = messages->pass->options->uncertainty == INCISE_EXPORT_PARTS ? value->n
									    : 0;

	for (int i = -1; i < n; i++) {
		double u = i < 0 ? incise_budget_total(quantity, part)
				 : part[value->first + i];

		to = add_messages_json(to, ",\"");
		to = add_messages_json(
			to, i < 0 ? value->total
				  : incise_budget_parts()[value->first + i].column);
		to = add_messages_json(to, "\":");
		/* JSON has no NaN. */
		to = isfinite(u) ? incise_decimal_real(to, u, 7)
				 : add_messages_json(to, "null");
	}
	return to;
}

/* Find the parts of the uncertainties of a row. Returns 0 or -errno. */
static int find_parts(struct incise_messages *messages,
		      const struct incise_stream_rows *stream, bool in_depth,
		      double part[INCISE_BUDGET_PARTS])
{
	struct incise_budget_row row = {.tracker_time = in_depth};
	struct incise_blade_pose_value value;
	int64_t t_ns = stream->rows.t_ns;

	if (!in_depth) {
		row.force_N = stream->cells[INCISE_CELL_FORCE].real;
		row.force_share = 1;
	} else {
		int rc = incise_blade_pose_at(&messages->blade, t_ns, 0, &value, NULL);

		if (rc)
			return rc;
		incise_blade_pose_budget(&messages->blade, t_ns, &value, &row);
	}
	incise_budget_row(messages->pass->budgets[0], &row, part);
	return 0;
}

static int64_t encode_members(struct incise_messages *messages,
			      const struct incise_stream_rows *stream)
{
	const struct incise_message_stream *kind =
		messages->kinds[stream - messages->streams];
	bool in_force = !strcmp(kind->table, "force");
	bool in_depth = !strcmp(kind->table, "depth");
	double part[INCISE_BUDGET_PARTS];
	char *to = messages->text;

	for (const struct incise_json_member *m = kind->members; m->before; m++)
		to = add_value(add_messages_json(to, m->before),
			       &stream->columns[m->cell], &stream->cells[m->cell]);
	if (messages->pass->budgets && (in_force || in_depth)) {
		int rc = find_parts(messages, stream, in_depth, part);

		if (rc)
			return rc;
		for (int q = in_depth ? INCISE_BUDGET_DEPTH : INCISE_BUDGET_FORCE;
		     q <= (in_depth ? INCISE_BUDGET_VELOCITY : INCISE_BUDGET_FORCE); q++)
			to = add_uncertainties(to, messages, q, part);
	}
	return add_messages_json(to, "}") - messages->text;
}

static const struct incise_json_member force[] = {
	{"{\"force_N\":", INCISE_CELL_FORCE},
	{",\"code\":", INCISE_CELL_CODE},
	{",\"clipped\":", INCISE_CELL_CLIPPED},
	{NULL},
};

static const struct incise_json_member tracker[] = {
	{"{\"position_mm\":{\"x\":", INCISE_CELL_POSITION},
	{",\"y\":", INCISE_CELL_POSITION + 1},
	{",\"z\":", INCISE_CELL_POSITION + 2},
	{"},\"orientation\":{\"w\":", INCISE_CELL_QUATERNION},
	{",\"x\":", INCISE_CELL_QUATERNION + 1},
	{",\"y\":", INCISE_CELL_QUATERNION + 2},
	{",\"z\":", INCISE_CELL_QUATERNION + 3},
	{"},\"status\":", INCISE_CELL_STATUS},
	{NULL},
};

static const struct incise_json_member depth[] = {
	{"{\"depth_mm\":", INCISE_CELL_DEPTH},
	{",\"velocity_mm_s\":", INCISE_CELL_VELOCITY},
	{NULL},
};

static const struct incise_json_member events[] = {
	{"{\"kind\":", INCISE_CELL_KIND},
	{",\"text\":", INCISE_CELL_TEXT},
	{NULL},
};

static const struct incise_message_stream streams[] = {
	{"force", encode_members, force, "/force", "incise.Force",
	 OBJECT("\"force_N\":" NUMBER("N") ",\"code\":{\"type\":\"integer\"},"
					   "\"clipped\":{\"type\":\"boolean\"}")},
	{"tracker", encode_members, tracker, "/tracker", "incise.Pose",
	 OBJECT("\"position_mm\":" OBJECT("\"x\":" NUMBER("mm") ",\"y\":" NUMBER("mm") ",\"z\":" NUMBER("mm")) ",\"orientation\":" OBJECT(
		 "\"w\":" NUMBER("unit quaternion") ",\"x\":" NUMBER("unit quaternion") ",\"y\":" NUMBER(
			 "unit quaternion") ",\"z\":" NUMBER("unit quaternion")) ",\"status\":{\"type\":\"string\"}")},
	{"depth", encode_members, depth, "/depth", "incise.Depth",
	 OBJECT("\"depth_mm\":" NUMBER("mm") ",\"velocity_mm_s\":" NUMBER("mm/s"))},
	{"events", encode_members, events, "/events", "incise.Event",
	 OBJECT("\"kind\":{\"type\":\"string\"},\"text\":{\"type\":\"string\"}")},
};

const struct incise_message_profile incise_messages_json = {
	.name = "",
	.encoding = "json",
	.schema_encoding = "jsonschema",
	.streams = streams,
	.n = sizeof(streams) / sizeof(*streams),
};
