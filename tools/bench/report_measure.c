// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Words of incise bench as programs of their own; see report_measure.h. What fails is in the
 * report with what it said, and the others go on.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/file.h"
#include "../cli/plot.h"
#include "report_measure.h"

#define POLL_US 50000
#define ASKED_S 20 /* to end what it has started, and itself */
#define LINES 20   /* of warnings that are kept */

static double now_s(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static char *path_of(const char *folder, const char *part, const char *name,
		     const char *suffix)
{
	char *path;

	if (asprintf(&path, "%s/%s%s%s", folder, part, name, suffix) < 0)
		cli_fail("no memory");
	return path;
}

/* Wait for its end, or for ours. */
static int wait_for(pid_t pid, const char *word, int number, int of)
{
	double begin = now_s();
	int status = 0;

	while (!child_ended(pid, &status)) {
		if (cli_stop) {
			kill(-pid, SIGTERM);
			for (double s = 0; s < ASKED_S; s += POLL_US * 1e-6) {
				if (child_ended(pid, &status))
					return status;
				usleep(POLL_US);
			}
			return child_end(pid, 0);
		}
		cli_progress("%s (%d of %d): %.0f s", word, number, of, now_s() - begin);
		usleep(POLL_US);
	}
	cli_progress_end();
	return status;
}

/*
 * What it said on standard error, line by line: warnings, but for the last line of one that
 * failed, which goes to @why. "incise bench: " is said by where it stands.
 */
static json_t *read_warnings(FILE *said, bool failed, char *why, size_t size)
{
	json_t *lines = json_array();
	char line[600];

	rewind(said);
	while (fgets(line, sizeof(line), said)) {
		char *text = line, *colon;

		line[strcspn(line, "\n")] = 0;
		colon = strncmp(line, "incise ", 7) ? NULL : strstr(line, ": ");
		text = colon ? colon + 2 : line;
		if (!strncmp(text, "warning: ", 9))
			text += 9;
		/* A hint to --help is for who types. */
		if (!*text || !strncmp(text, "Try 'incise ", 12))
			continue;
		snprintf(why, size, "%s", text);
		if (json_array_size(lines) < LINES)
			json_array_append_new(lines, json_text(text));
	}
	if (failed && json_array_size(lines))
		json_array_remove(lines, json_array_size(lines) - 1);
	return lines;
}

static void note(const struct report_measure *m, const char *word, const char *state,
		 double seconds, const char *why, json_t *warnings)
{
	if (!strcmp(state, "failed"))
		json_array_append_new(json_object_get(m->report, "failed"),
				      json_string(word));
	json_object_set_new(json_object_get(m->report, "runs"), word,
			    json_pack("{ss sf so so}", "state", state, "seconds", seconds,
				      "why", *why ? json_text(why) : json_null(),
				      "warnings", warnings));
}

/* Its figures once more, named with the word, among those of all. */
static void add_figures(json_t *report, const char *word, const json_t *json)
{
	const json_t *figure;
	size_t i;

	json_array_foreach(json_object_get(json, "figures"), i, figure)
	{
		const char *name = json_string_value(json_object_get(figure, "name"));
		json_t *copy;

		if (!json_is_object(figure))
			continue;
		copy = json_copy((json_t *)figure);
		json_object_set_new(copy, "name",
				    json_sprintf("%s: %s", word, name ? name : ""));
		json_array_append_new(json_object_get(report, "figures"), copy);
	}
}

/* Start it, and wait; its JSON into a file. */
static int run(const struct report_measure *m, const struct report_section *s,
	       const char *program, const char *data, FILE *said, int number, int of)
{
	char *picture = path_of(m->folder, "pictures/", s->word, "");
	const char *argv[8] = {program};
	int n = 1, status;
	FILE *out = fopen(data, "we");

	if (!out)
		cli_fail("%s: %s", data, strerror(errno));
	/* A word that is a program of its own is not said once more. */
	if (!strcmp(s->program, "incise-bench"))
		argv[n++] = s->word;
	argv[n++] = "--json";
	if (m->quick)
		argv[n++] = "--quick";
	if (s->pictures[0].part && plot_possible()) {
		argv[n++] = "--plot";
		argv[n++] = picture;
	}
	status = wait_for(child_start((char *const *)argv, fileno(out), fileno(said)),
			  s->word, number, of);
	fclose(out);
	free(picture);
	return status;
}

void report_measure(const struct report_measure *m, const struct report_section *s,
		    int number, int of)
{
	char *program = path_of(cli_folder(), "", s->program, ""),
	     *data = path_of(m->folder, "data/", s->word, ".json");
	struct memory_file said = memory_file_begin("said");
	char why[600] = "";
	double begin = now_s();
	json_t *json, *warnings;
	struct incise_error err = {0};
	int status;

	if (access(program, X_OK)) {
		snprintf(why, sizeof(why),
			 "%s is not there: it is built where its libraries are",
			 s->program);
		note(m, s->word, "left out", 0, why, json_array());
	} else {
		status = run(m, s, program, data, said.file, number, of);
		json = json_read(data, &err);
		warnings = read_warnings(said.file, status != 0, why, sizeof(why));
		if (WIFSIGNALED(status))
			snprintf(why, sizeof(why), "ended by a signal: %s",
				 strsignal(WTERMSIG(status)));
		else if (!json_is_object(json) && !status)
			snprintf(why, sizeof(why), "what it reported is no JSON: %s",
				 *err.text ? err.text : "no object");
		else if (!status)
			*why = 0;
		note(m, s->word, *why ? "failed" : "measured", now_s() - begin, why,
		     warnings);
		if (json_is_object(json)) {
			add_figures(m->report, s->word, json);
			json_object_set(json_object_get(m->report, "words"), s->word,
					json);
		} else {
			unlink(data);
		}
		json_decref(json);
	}
	fclose(said.file);
	free(program);
	free(data);
}
