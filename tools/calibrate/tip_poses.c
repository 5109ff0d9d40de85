// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Poses for incise calibrate tip; see tip_poses.h. CSV has a line of names and a line per
 * pose: t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz, in any order; t_s may be missing.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "tip_poses.h"
#include "../cli/file.h"

#define COLUMNS 8
#define CSV_MAX 32 /* columns that a file may have */
#define POSES_MAX 1000000

static const char *const names[COLUMNS] = {"t_s", "x_mm", "y_mm", "z_mm",
					   "qw",  "qx",	  "qy",	  "qz"};

static struct incise_tip_pose *next(struct tip_list *list)
{
	if (list->n == list->room) {
		list->room = list->room ? 2 * list->room : 4096;
		list->poses =
			list->room > 2 * POSES_MAX
				? NULL
				: realloc(list->poses,
					  (size_t)list->room * sizeof(*list->poses));
		if (!list->poses)
			cli_fail("too many poses; a minute of them will do");
	}
	return &list->poses[list->n++];
}

void tip_list_add(struct tip_list *list, const struct incise_tracker_sample *sample)
{
	struct incise_tip_pose *pose;

	if (sample->status != ' ') {
		list->doubtful++;
		return;
	}
	pose = next(list);
	pose->t_ns = sample->t_ns;
	memcpy(pose->position_mm, sample->position_mm, sizeof(pose->position_mm));
	memcpy(pose->quaternion, sample->quaternion, sizeof(pose->quaternion));
}

static void read_recording(struct tip_list *list, const char *path)
{
	struct incise_error err = {0};
	struct incise_recording *recording = incise_recording_open(path, &err);
	struct incise_tracker_sample *samples;
	int n;

	if (!recording)
		cli_fail_with(&err);
	n = incise_recording_poses(recording, &samples, &err);
	if (n < 0)
		cli_fail_with(&err);
	for (int i = 0; i < n; i++)
		tip_list_add(list, &samples[i]);
	free(samples);
	incise_recording_close(recording);
}

/* Fields of a line, cut in place. How many; more than CSV_MAX are not looked at. */
static int fields_of(char *line, char **fields)
{
	int n = 0;

	line[strcspn(line, "\r\n")] = 0;
	for (char *field; n < CSV_MAX && (field = strsep(&line, ","));)
		fields[n++] = field + strspn(field, " \t");
	return n;
}

static void find_columns(const char *path, char **fields, int n, int at[COLUMNS])
{
	for (int c = 0; c < COLUMNS; c++) {
		at[c] = -1;
		for (int i = 0; i < n; i++)
			if (!strcmp(fields[i], names[c]))
				at[c] = i;
		if (at[c] < 0 && c)
			cli_fail(
				"%s: line 1 has no column '%s'; it is to name t_s, x_mm, "
				"y_mm, z_mm, qw, qx, qy, qz",
				path, names[c]);
	}
}

static void read_csv(struct tip_list *list, const char *path)
{
	FILE *file = fopen(path, "re");
	char *line = NULL, *fields[CSV_MAX];
	int at[COLUMNS], number = 0;
	size_t size = 0;

	if (!file)
		cli_fail("%s: %s", path, strerror(errno));
	while (getline(&line, &size, file) >= 0) {
		int n;

		number++;
		if (*line == '#' || !line[strspn(line, " \t\r\n")])
			continue;
		n = fields_of(line, fields);
		if (!list->room) {
			find_columns(path, fields, n, at);
			list->room = 4096;
			list->poses = malloc((size_t)list->room * sizeof(*list->poses));
			if (!list->poses)
				cli_fail("no memory");
			continue;
		}
		double values[COLUMNS] = {list->n};

		for (int c = 0; c < COLUMNS; c++) {
			char *end;

			if (at[c] < 0)
				continue;
			if (at[c] >= n)
				cli_fail("%s: line %d: '%s' is missing", path, number,
					 names[c]);
			values[c] = strtod(fields[at[c]], &end);
			if (end == fields[at[c]] || end[strspn(end, " \t")] ||
			    !isfinite(values[c]) || (!c && fabs(values[c]) > 1e9))
				cli_fail("%s: line %d: %s: '%s' is no number", path,
					 number, names[c], fields[at[c]]);
		}
		struct incise_tip_pose *pose = next(list);

		pose->t_ns = llround(values[0] * 1e9);
		memcpy(pose->position_mm, values + 1, sizeof(pose->position_mm));
		memcpy(pose->quaternion, values + 4, sizeof(pose->quaternion));
	}
	if (ferror(file))
		cli_fail("%s: %s", path, strerror(errno));
	free(line);
	fclose(file);
}

void tip_list_read(struct tip_list *list, const char *path)
{
	struct stat st;

	if (stat(path, &st) && errno != ENOENT)
		cli_fail("%s: %s", path, strerror(errno));
	/* the name of a recording that only its .part is there of, too */
	if (S_ISDIR(st.st_mode) ||
	    (strlen(path) > 4 && !strcmp(path + strlen(path) - 4, ".rec")))
		read_recording(list, path);
	else
		read_csv(list, path);
}

void tip_list_write(const struct tip_list *list, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);

	fprintf(out, "t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n");
	for (int i = 0; i < list->n; i++) {
		const struct incise_tip_pose *pose = &list->poses[i];

		fprintf(out, "%.9f", (pose->t_ns - list->poses[0].t_ns) * 1e-9);
		for (int k = 0; k < 3; k++)
			fprintf(out, ",%.17g", pose->position_mm[k]);
		for (int k = 0; k < 4; k++)
			fprintf(out, ",%.17g", pose->quaternion[k]);
		putc('\n', out);
	}
	whole_file_end(file);
}
