/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a verification finds, for the tests of lib/record/verify*.c.
 */
#ifndef TEST_VERIFIED_H
#define TEST_VERIFIED_H

#include "recorded.h"
#include <incise/verify.h>

struct findings {
	struct incise_verify_finding first;
	char text[2000]; /* all lines */
};

static void found(void *user, const struct incise_verify_finding *finding)
{
	struct findings *findings = user;
	size_t n = strlen(findings->text);

	assert_null(strchr(finding->text, '\n'));
	snprintf(findings->text + n, sizeof(findings->text) - n, "%s\n", finding->text);
	if (n == 0)
		findings->first = *finding;
}

static void verify(const char *path, struct incise_verify_report *report,
		   struct findings *findings)
{
	struct incise_verify_watch watch = {.found = found, .user = findings};
	struct incise_error err = {0};

	memset(findings, 0, sizeof(*findings));
	if (incise_verify(path, &watch, report, &err))
		fail_msg("%s", err.text);
}

#endif
