// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The statement of a join: the members, their clocks, and how they were found; see incise/session.h.
 * It is made of what is read, not of the tables, and the members' own statements complete it.
 */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../../base/c_locale.h"
#include "../read/session.h"
#include "../schema.h"
#include "seal_walk.h"

/* Unknown without a sign, which nan may have. */
static double plain_seal_join(double value)
{
	return isnan(value) ? NAN : value;
}

/* "map 12 0123…": the number of knots and the SHA-256 of their lines. Returns 0 or -errno. */
static int write_map(FILE *out, const struct incise_session_map *map)
{
	struct incise_sha256 sha = {0};
	char text[INCISE_SHA256_TEXT];

	incise_sha256_start(&sha);
	for (size_t i = 0; i < map->n; i++) {
		const struct incise_session_knot *knot = &map->knots[i];
		char line[100];
		int n = snprintf(line, sizeof(line), "%" PRId64 " %" PRId64 " %.17g\n",
				 knot->t_ns, knot->to_ns, knot->bound_ns);

		incise_sha256_add(&sha, line, (size_t)n);
	}
	if (incise_sha256_end(&sha, text))
		return -ENOMEM;
	fprintf(out, "map %zu %s\n", map->n, text);
	return 0;
}

static int write_member(FILE *out, const struct incise_session *session, int at,
			struct incise_error *err)
{
	const struct incise_session_info *info = &session->info[at];
	struct incise_seal_head head;
	char identity[33];
	int rc = incise_seal_head(session->members[at], identity, &head, err);

	if (rc)
		return rc;
	fprintf(out,
		"member %s\nidentity %s\ncommit %" PRId64 " %" PRId64 " %s\nhost %s\n"
		"method %s\nsignals %d %.17g %.17g\n",
		info->name, identity, head.commit, head.t_ns, head.head, info->host,
		info->method, info->matches, plain_seal_join(info->agreement_ns),
		plain_seal_join(info->agreement_bound_ns));
	rc = write_map(out, &session->maps[at]);
	return rc ? incise_error_set(err, -rc, "%s: out of memory",
				     session->members[at]->path)
		  : 0;
}

char *incise_session_statement(const struct incise_recording *recording,
			       struct incise_error *err)
{
	const struct incise_session *session = recording->session;
	struct incise_c_locale locale = incise_c_locale_begin();
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);
	int rc = out ? 0 : -ENOMEM;

	if (!session)
		rc = incise_error_set(err, EINVAL, "%s: is no joined recording",
				      recording->path);
	if (!rc)
		fputs("incise statement 1 of a join\n", out);
	for (int i = 0; !rc && i < session->n; i++)
		rc = write_member(out, session, i, err);
	if (!rc)
		fputs("end\n", out);
	if (out && fclose(out) && !rc)
		rc = -ENOMEM;
	incise_c_locale_end(locale);
	if (!rc)
		return text;
	free(text);
	if (rc == -ENOMEM)
		incise_schema_no_memory(recording->path, err);
	errno = -rc;
	return NULL;
}
