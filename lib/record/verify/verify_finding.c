// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Findings and progress of a verification; see verify.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <time.h>
#include "verify.h"

#define REPORT_NS 100000000LL

double incise_verify_s(const struct incise_verification *verify, int64_t t_ns)
{
	return ((double)t_ns - (double)verify->origin_ns) * 1e-9;
}

struct incise_verify_finding incise_verify_finding(enum incise_verify_kind kind)
{
	return (struct incise_verify_finding){
		.kind = kind,
		.stream = "",
		.first_block = -1,
		.last_block = -1,
		.last_seq = -1,
		.first_ns = -1,
		.last_ns = -1,
	};
}

void incise_verify_found(struct incise_verification *verify,
			 struct incise_verify_finding finding, const char *fmt, ...)
{
	char line[400];
	va_list args;

	va_start(args, fmt);
	vsnprintf(line, sizeof(line), fmt, args);
	va_end(args);
	/* Names and values may come from the file: no control characters. */
	for (char *c = line; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	verify->report->findings++;
	verify->report->unverified |= finding.kind == INCISE_VERIFY_UNVERIFIED;
	verify->altered |= finding.kind != INCISE_VERIFY_LOST &&
			   finding.kind != INCISE_VERIFY_INTERRUPTED &&
			   finding.kind != INCISE_VERIFY_ENDED &&
			   finding.kind != INCISE_VERIFY_TIMES;
	finding.text = line;
	if (verify->watch && verify->watch->found)
		verify->watch->found(verify->watch->user, &finding);
}

void incise_verify_unreadable(struct incise_verification *verify, const char *stream,
			      const char *table)
{
	struct incise_verify_finding finding =
		incise_verify_finding(INCISE_VERIFY_DAMAGED);

	finding.stream = stream;
	incise_verify_found(verify, finding, "table %s cannot be read: %s", table,
			    sqlite3_errmsg(verify->recording->db));
}

int incise_verify_progress(struct incise_verification *verify, bool pages)
{
	double share = verify->rows_done < verify->rows
			       ? (double)verify->rows_done / verify->rows
			       : 1;
	struct timespec now;
	int64_t now_ns;

	if (!verify->watch || !verify->watch->progress)
		return 0;
	clock_gettime(CLOCK_MONOTONIC, &now);
	now_ns = now.tv_sec * 1000000000LL + now.tv_nsec;
	if (now_ns - verify->reported_ns < REPORT_NS)
		return 0;
	verify->reported_ns = now_ns;
	return verify->watch->progress(verify->watch->user, pages ? -1 : share)
		       ? -ECANCELED
		       : 0;
}
