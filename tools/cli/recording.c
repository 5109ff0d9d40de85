// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A recording that exists already; see recording.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/prove.h>
#include <incise/recalibration.h>
#include "cli.h"
#include "file_kind.h"
#include "recording.h"

struct incise_recording *recording_open(const char *path)
{
	struct incise_error err = {0};

	file_expect(path, FILE_RECORDING);
	return cli_require(incise_recording_open(path, &err), &err);
}

int recording_altered(const char *path, bool samples, struct incise_error *err)
{
	const struct incise_prove_options options = {
		.level = samples ? INCISE_PROVE_ROWS : INCISE_PROVE_TABLES};
	struct incise_proof proof;
	int rc = incise_prove(path, &options, &proof, err);

	if (!rc && *proof.altered) {
		incise_error_set(err, EINVAL, "%s: not as it was recorded: %s", path,
				 proof.altered);
		rc = 1;
	}
	incise_proof_free(&proof);
	return rc;
}

bool recording_intact(const char *path, bool samples, bool damaged,
		      struct incise_error *err)
{
	struct incise_error found = {0};
	int altered = recording_altered(path, samples, &found);

	if (!altered)
		return true;
	if (altered < 0)
		*err = found;
	else if (damaged)
		cli_warn("%s", found.text);
	else
		incise_error_set(err, EINVAL,
				 "%s; 'incise verify %s' lists all; --damaged uses it as "
				 "it is",
				 found.text, path);
	return false;
}

/* Remove the members of a joined recording: the folders in it with a recording, each with nothing else. */
static void remove_members(const char *path)
{
	char *pattern = cli_text("%s/*/recording.db", path);
	glob_t found;

	if (!glob(pattern, 0, NULL, &found)) {
		for (size_t i = 0; i < found.gl_pathc; i++) {
			*strrchr(found.gl_pathv[i], '/') = 0;
			recording_remove(found.gl_pathv[i]);
		}
		globfree(&found);
	}
	free(pattern);
}

/* Remove the calibrations of incise recalibrate, in a folder of their own. */
static void remove_calibrations(int folder, const char *path)
{
	struct incise_recalibration *list;
	int n = incise_recalibrations(path, &list, NULL);

	for (int i = 1; i < n; i++)
		if (unlinkat(folder, list[i].file, 0))
			cli_fail("%s/%s: cannot be removed: %s", path, list[i].file,
				 strerror(errno));
	free(list);
	if (unlinkat(folder, "calibration", AT_REMOVEDIR) && errno != ENOENT)
		cli_fail("%s/calibration: cannot be removed: %s", path, strerror(errno));
}

void recording_remove(const char *path)
{
	static const char *const files[] = {"recording.db", "recording.db-wal",
					    "recording.db-shm", "recording.db-journal",
					    "camera.mkv"};
	int folder = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
	struct incise_error err = {0};

	if (folder < 0 && errno == ENOENT)
		return;
	if (folder < 0)
		cli_fail("%s: cannot be replaced: %s", path, strerror(errno));
	if (flock(folder, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK)
		cli_fail("%s: another incise capture is writing it; end that one, or "
			 "give another name",
			 path);
	remove_members(path);
	remove_calibrations(folder, path);
	cli_check(incise_proof_remove(path, &err), &err);
	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		if (unlinkat(folder, files[i], 0) && errno != ENOENT)
			cli_fail("%s/%s: cannot be removed: %s", path, files[i],
				 strerror(errno));
	close(folder);
	if (rmdir(path))
		cli_fail("%s: cannot be removed: %s", path, strerror(errno));
}

/* Fail if recording_replace() could not replace what is at @path. */
static void check_recording(const char *path)
{
	char file[PATH_MAX];
	struct stat st;

	if (lstat(path, &st)) {
		if (errno == ENOENT)
			return;
		cli_fail("%s: %s", path, strerror(errno));
	}
	snprintf(file, sizeof(file), "%s/recording.db", path);
	if (!S_ISDIR(st.st_mode) || (access(file, F_OK) && rmdir(path)))
		cli_fail("%s: not a recording, so --overwrite does not replace it; give "
			 "another name",
			 path);
}

/* Without the slashes that completion puts behind a folder. */
static char *make_plain_path(const char *path)
{
	size_t n = strlen(path);

	while (n > 1 && path[n - 1] == '/')
		n--;
	return cli_text("%.*s", (int)n, path);
}

char *recording_target(const char *given)
{
	char *path = make_plain_path(given);
	char *target = cli_text("%s%s", path, cli_overwrite() ? ".new" : "");
	char *part = cli_text("%s.part", path), *rest = cli_text("%s.part", target);

	if (cli_overwrite()) {
		check_recording(path);
		recording_remove(part);
		recording_remove(rest);
		recording_remove(target);
	}
	free(path);
	free(part);
	free(rest);
	return target;
}

static void replace(const char *new, const char *path)
{
	if (!strcmp(new, path))
		return;
	if (access(path, F_OK)) {
		if (rename(new, path))
			cli_fail("%s: %s; the recording is in %s", path, strerror(errno),
				 new);
		return;
	}
	if (renameat2(AT_FDCWD, new, AT_FDCWD, path, RENAME_EXCHANGE)) {
		if (errno != EINVAL && errno != ENOSYS)
			cli_fail("%s: %s; the recording is in %s", path, strerror(errno),
				 new);
		recording_remove(path); /* a file system without that call */
		if (rename(new, path))
			cli_fail("%s: %s; the recording is in %s", path, strerror(errno),
				 new);
		return;
	}
	recording_remove(new);
}

void recording_replace(const char *new, const char *given)
{
	char *path = make_plain_path(given);

	replace(new, path);
	free(path);
}

void recording_cuts_step(struct recording_cuts *cuts, double t_s, double depth_mm)
{
	if (!cuts->inside && depth_mm > INCISE_CUT_START_MM) {
		if (cuts->n < RECORDING_CUTS_MOST)
			cuts->cut[cuts->n++] = (struct recording_cut){t_s, t_s};
		cuts->inside = true;
	} else if (cuts->inside && depth_mm < INCISE_CUT_END_MM) {
		cuts->inside = false;
	}
	if (cuts->inside && cuts->n)
		cuts->cut[cuts->n - 1].to_s = t_s;
}

bool recording_shows_event(const char *kind)
{
	static const char *const kinds[] = {"marker", "button", "trigger",
					    "failed", "silent", "rate"};

	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
		if (!strcmp(kind, kinds[i]))
			return true;
	return false;
}
