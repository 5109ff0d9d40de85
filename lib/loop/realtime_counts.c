// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Faults and switches of a thread, as the kernel counts them; see incise/realtime.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "proc_file.h"
#include "realtime.h"

/* A number and what follows it, or NULL. */
static const char *number(const char *text, uint64_t *value)
{
	char *end;

	while (*text == ' ' || *text == '\t')
		text++;
	if (*text < '0' || *text > '9')
		return NULL;
	errno = 0;
	*value = strtoull(text, &end, 10);
	return errno ? NULL : end;
}

/*
 * TID (NAME) S ppid pgrp session tty tpgid flags minflt cminflt majflt …; the name is the
 * program's and may have brackets and blanks.
 */
static int read_faults(const char *text, struct incise_realtime_counts *counts)
{
	const char *at = strrchr(text, ')');
	uint64_t children;

	if (!at)
		return -EIO;
	at++;
	for (int field = 3; field < 10; field++) {
		at += strspn(at, " ");
		at += strcspn(at, " ");
	}
	at = number(at, &counts->minor_faults);
	at = at ? number(at, &children) : NULL;
	at = at ? number(at, &counts->major_faults) : NULL;
	return at ? 0 : -EIO;
}

static int read_line(const char *text, const char *key, uint64_t *value)
{
	const char *at = strstr(text, key);

	return at && number(at + strlen(key), value) ? 0 : -EIO;
}

int realtime_count_below(const char *folder, int tid,
			 struct incise_realtime_counts *counts)
{
	struct incise_realtime_counts read = {0};
	char path[64], text[8192];
	int rc;

	*counts = read;
	snprintf(path, sizeof(path), "/%d/stat", tid);
	rc = proc_file_read(folder, path, text, sizeof(text));
	if (rc >= 0)
		rc = read_faults(text, &read);
	snprintf(path, sizeof(path), "/%d/status", tid);
	if (!rc)
		rc = proc_file_read(folder, path, text, sizeof(text));
	if (rc >= 0)
		rc = read_line(text, "\nvoluntary_ctxt_switches:", &read.voluntary);
	if (!rc)
		rc = read_line(text, "\nnonvoluntary_ctxt_switches:", &read.involuntary);
	if (rc)
		return rc == -ENOENT || rc == -ESRCH ? -ESRCH : -EIO;
	*counts = read;
	return 0;
}

int incise_realtime_count(int tid, struct incise_realtime_counts *counts)
{
	return realtime_count_below("/proc/self/task", tid, counts);
}
