// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Writing a session; see log.h.
 */
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/outfile.h>
#include "../cli/json.h"
#include "log.h"

struct session_log {
	struct session_digest *digest;
	struct incise_outfile *file;
};

void session_path_parse(void *path, char *text)
{
	(void)path;
	if (!strcmp(text, "-"))
		cli_usage("--output: expected a file, not standard output, which "
			  "reports use");
}

void session_code_parse(void *code, char *text)
{
	if (!session_is_code(text))
		cli_usage("--code: expected up to %2$d letters, digits, '-' and '_', "
			  "found '%1$.40s'; do not give a person's name",
			  text, SESSION_CODE_MAX);
	*(const char **)code = text;
}

void session_options_check(const struct session_options *options)
{
	if (options->code && !options->path)
		cli_usage("--code needs -o FILE.session (file to write)");
}

/*
 * A path without its folders, which may be of a person's home, and other text as it is; as much of
 * the end as there is place for.
 */
static void copy_name(char *to, size_t size, const char *text)
{
	const char *slash = access(text, F_OK) ? NULL : strrchr(text, '/');
	size_t n;

	text = slash && slash[1] ? slash + 1 : text;
	n = strlen(text);
	snprintf(to, size, "%s", n < size ? text : text + (n - size + 1));
}

static void describe_log(struct session_log *log, const struct session_options *options,
			 const struct session_start *start, uint32_t crc32c)
{
	struct session *s = session_digest_now(log->digest);
	struct timespec now;

	snprintf(s->program, sizeof(s->program), "%s", start->program);
	copy_name(s->source, sizeof(s->source), start->source);
	copy_name(s->scene.path, sizeof(s->scene.path), start->scene_path);
	snprintf(s->scene.crc32c, sizeof(s->scene.crc32c), "%08x", crc32c);
	snprintf(s->code, sizeof(s->code), "%s", options->code ? options->code : "");
	if (!start->real)
		return;
	clock_gettime(CLOCK_REALTIME, &now);
	s->start_unix_s = (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

struct session_log *session_log_begin(const struct session_options *options,
				      const struct session_start *start)
{
	struct incise_error err = {0};
	struct session_log *log;
	uint32_t crc32c;

	if (!options->path)
		return NULL;
	log = cli_alloc(1, sizeof(*log));
	cli_check(incise_scene_checksum(start->scene, &crc32c, &err), &err);
	log->digest = cli_require(session_digest_new(start->scene, &err), &err);
	describe_log(log, options, start, crc32c);
	log->file = cli_require(incise_outfile_open(options->path, &err), &err);
	return log;
}

void session_log_tick(struct session_log *log, const struct incise_tick *tick)
{
	if (log)
		session_digest_tick(log->digest, tick);
}

void session_log_lost(struct session_log *log, uint64_t lost)
{
	if (log)
		session_digest_lost(log->digest, lost);
}

int session_log_end(struct session_log *log, const char *kind, const char *why,
		    struct incise_error *err)
{
	struct session *s;
	json_t *json;
	int rc;

	if (!log)
		return 0;
	s = session_digest_now(log->digest);
	snprintf(s->end.kind, sizeof(s->end.kind), "%s", kind);
	snprintf(s->end.why, sizeof(s->end.why), "%s", why);
	json = session_json(s);
	json_write(incise_outfile_stream(log->file), json,
		   JSON_INDENT(1) | JSON_REAL_PRECISION(15));
	json_decref(json);
	rc = incise_outfile_commit(log->file, err);
	session_digest_free(log->digest);
	free(log);
	return rc;
}
