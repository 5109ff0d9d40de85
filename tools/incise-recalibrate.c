// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise recalibrate: gives a recording another calibration after the fact, or the one of its
 * capture back.
 */
#include <math.h>
#include <stdio.h>
#include <incise/recalibration.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/recording.h"

struct recalibrate_job {
	const char *calibration;
	bool original, json;
};

static const struct cli_option options[] = {
	{'c', "calibration", "FILE", "calibration to copy into the recording, and to use",
	 CLI_INPUT(struct recalibrate_job, calibration)},
	{0, "original", NULL, "use the calibration of the capture again",
	 CLI_FLAG(struct recalibrate_job, original)},
	{0, "json", NULL, "report as one JSON object",
	 CLI_FLAG(struct recalibrate_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "recalibrate",
	.synopsis = "NAME.rec -c FILE | --original [OPTIONS]",
	.summary =
		"Give a recording another calibration after the fact. What was recorded "
		"stays as it is; export, train, plot, replay, join and Python use the "
		"calibration that is active.",
	.options = options,
	.examples = "incise recalibrate liver.rec -c calibration.conf",
};

/* Values that a calibration can move; delays are of the streams. */
struct values {
	double numbers[8];
};

static const struct {
	const char *key, *unit;
} keys[] = {{"force_mV_N", "mV/N"}, {"force_zero_mV", "mV"}, {"depth_mm_px", "mm/px"},
	    {"tip_x_mm", "mm"},	    {"tip_y_mm", "mm"},	     {"tip_z_mm", "mm"},
	    {"depth_max_mm", "mm"}, {"force_max_N", "N"}};

#define KEYS (sizeof(keys) / sizeof(*keys))

/* Returns whether they can be read. */
static bool read_values(const char *path, struct values *values,
			struct incise_recording_info *info, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open(path, err);
	int rc = recording ? incise_recording_measure(recording, info, err) : -err->code;

	incise_recording_close(recording);
	if (!rc)
		*values = (struct values){{info->force_mV_N, info->zero_mV,
					   info->depth_mm_px, info->tip_mm[0],
					   info->tip_mm[1], info->tip_mm[2],
					   info->depth_max_mm, info->force_max_N}};
	return !rc;
}

static bool differ(double a, double b)
{
	return isnan(a) ? !isnan(b) : !(a == b);
}

/* Nothing, if a value is as it was. */
static void add_change(json_t *list, const char *key, const char *unit, double before,
		       double now)
{
	if (differ(before, now))
		json_array_append_new(list, json_pack("{ss ss so so}", "key", key, "unit",
						      unit, "before", json_number(before),
						      "now", json_number(now)));
}

static json_t *changes_json(const struct values *before, const struct values *now,
			    const struct incise_recording_info *was,
			    const struct incise_recording_info *is)
{
	json_t *list = json_array();

	for (size_t i = 0; i < KEYS; i++)
		add_change(list, keys[i].key, keys[i].unit, before->numbers[i],
			   now->numbers[i]);
	for (int i = 0; i < is->n_streams; i++) {
		char name[40];

		snprintf(name, sizeof(name), "%s_delay_ms", is->streams[i].name);
		add_change(list, name, "ms", was->streams[i].delay_ms,
			   is->streams[i].delay_ms);
	}
	return list;
}

static void print_number(const json_t *value)
{
	if (json_is_null(value))
		fputs("unknown", stdout);
	else
		printf("%.6g", json_number_value(value));
}

static void print_changes(const json_t *changes)
{
	for (size_t i = 0; i < json_array_size(changes); i++) {
		const json_t *change = json_array_get(changes, i);

		printf("%-18s ", json_string_value(json_object_get(change, "key")));
		print_number(json_object_get(change, "before"));
		fputs(" -> ", stdout);
		print_number(json_object_get(change, "now"));
		printf(" %s\n", json_string_value(json_object_get(change, "unit")));
	}
	if (!json_array_size(changes))
		puts("no value differs from those before");
}

int main(int argc, char **argv)
{
	struct incise_recalibration made;
	struct incise_recording_info was = {0}, is = {0};
	struct values before, now;
	struct incise_error err = {0};
	struct recalibrate_job job = {0};
	const char *path;
	json_t *changes;
	bool known;

	cli_parse(&command, argc, argv, &job);
	path = file_operand(cli_operand(argc, argv, "NAME.rec",
					"recording to recalibrate"),
			    FILE_RECORDING);
	if (!job.calibration == !job.original)
		cli_usage(job.original
				  ? "-c FILE and --original exclude each other; give "
				    "one of them"
				  : "missing -c FILE (calibration to use), or "
				    "--original");
	if (job.calibration)
		file_expect(job.calibration, FILE_CALIBRATION);
	/* Where the active one is damaged, the way to another must work. */
	known = read_values(path, &before, &was, &err);
	cli_check(incise_recalibrate(path, job.calibration, &made, &err) ||
			  !read_values(path, &now, &is, &err),
		  &err);
	if (!known) {
		before = now;
		was = is;
	}
	changes = changes_json(&before, &now, &was, &is);
	if (job.json) {
		json_print(json_pack("{so ss ss so so}", "path", json_text(path), "file",
				     made.file, "date", made.date, "sha256",
				     json_text_or_null(made.sha256), "changes", changes));
	} else {
		if (known)
			print_changes(changes);
		json_decref(changes);
		printf("wrote %s/%s\n", path, made.file);
	}
	cli_finish();
	return 0;
}
