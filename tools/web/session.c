// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A session in the viewer: depth and force over time, the tool's path, and the criteria; see web.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/loop_report.h"
#include "../session/session.h"
#include "web.h"

struct web_session {
	struct web_file base;
	struct session *session;
	struct web_series depth, force;
};

static json_t *path_of(const struct session *s)
{
	json_t *t = json_array(), *x = json_array(), *y = json_array();

	for (int i = 0; i < s->n_trace; i++) {
		json_array_append_new(t, json_real(s->trace[i].t_s));
		json_array_append_new(x, json_real(s->trace[i].tool_mm[0]));
		json_array_append_new(y, json_real(s->trace[i].tool_mm[1]));
	}
	return json_pack("{ss so so so}", "unit", "mm", "t", t, "x", x, "y", y);
}

static json_t *criteria_of(const struct session *s)
{
	struct session_verdict verdict[INCISE_CRITERIA];
	json_t *rows = json_array();
	char value[32], required[48];

	session_judge(s, verdict);
	for (int i = 0; i < INCISE_CRITERIA; i++) {
		session_criterion_value(i, verdict[i].value, value, sizeof(value));
		session_criterion_asked(i, &s->criteria[i], required, sizeof(required));
		json_array_append_new(
			rows, json_pack("[so]", session_criterion_label(i),
					json_taken(cli_text(
						"%s %s", value,
						isnan(verdict[i].value)
							? ""
							: session_criterion_unit(i)))));
		json_array_append_new(json_array_get(rows, (size_t)i),
				      json_text(required));
		json_array_append_new(json_array_get(rows, (size_t)i),
				      json_string(!verdict[i].judged ? "-"
						  : verdict[i].met   ? "yes"
								     : "no"));
	}
	return json_pack("{s[ssss] so}", "head", "criterion", "value", "required", "met",
			 "rows", rows);
}

static json_t *web_session_head(struct web_file *file)
{
	const struct session *s = ((struct web_session *)file)->session;
	json_t *head = web_head_new("session", file->path, "time", "s", 0,
				    fmax(s->duration_s, 1e-3));
	json_t *cuts = json_object_get(head, "cuts"),
	       *events = json_object_get(head, "events");

	web_head_panel(head, "depth", "mm", "depth");
	web_head_panel(head, "force", "N", "force");
	for (int i = 0; i < s->n_phases; i++)
		json_array_append_new(cuts, json_pack("[ffs]", s->phase[i].from_s,
						      s->phase[i].to_s,
						      loop_tool_names[s->phase[i].tool]));
	if (s->target.hit)
		json_array_append_new(events, json_pack("[fss]", s->target.t_s, "target",
							"the membrane was reached"));
	if (isfinite(s->force.t_s))
		json_array_append_new(events, json_pack("[fss]", s->force.t_s, "force",
							"largest force"));
	json_object_set_new(head, "path", path_of(s));
	json_object_set_new(head, "table", criteria_of(s));
	json_object_set_new(head, "facts",
			    json_pack("[[so][so][ss]]", "scene", json_text(s->scene.path),
				      "code", json_text(s->code), "ended", s->end.kind));
	return head;
}

static int web_session_part(struct web_file *file, double from, double to, int columns,
			    FILE *out, struct incise_error *err)
{
	const struct web_session *w = (struct web_session *)file;

	(void)err;
	fprintf(out, "{\"from\":%.10g,\"to\":%.10g,\"done\":1,\"tracks\":[", from, to);
	web_series_put(&w->depth, from, to, columns, NULL, NULL, out);
	fputc(',', out);
	web_series_put(&w->force, from, to, columns, NULL, NULL, out);
	fputs("]}", out);
	return 0;
}

static void web_session_close(struct web_file *file)
{
	struct web_session *w = (struct web_session *)file;

	web_series_free(&w->depth);
	web_series_free(&w->force);
	free(w->session);
	free(w);
}

static const struct web_kind web_session_kind = {
	.head = web_session_head, .part = web_session_part, .close = web_session_close};

struct web_file *web_session_open(const char *path)
{
	struct web_session *w = cli_alloc(1, sizeof(*w));
	struct incise_error err = {0};
	const struct session *s;

	w->base = (struct web_file){&web_session_kind, path};
	s = w->session = cli_require(session_read(path, &err), &err);
	if (!s->n_trace)
		cli_fail("%s: ended before its first tick", path);
	web_series_init(&w->depth, 0, fmax(s->duration_s, 1e-3), SESSION_TRACE_MAX,
			s->n_trace);
	web_series_init(&w->force, 0, fmax(s->duration_s, 1e-3), SESSION_TRACE_MAX,
			s->n_trace);
	for (int i = 0; i < s->n_trace; i++) {
		web_series_add(&w->depth, s->trace[i].t_s, s->trace[i].depth_mm);
		web_series_add(&w->force, s->trace[i].t_s, s->trace[i].force_N);
	}
	return &w->base;
}
