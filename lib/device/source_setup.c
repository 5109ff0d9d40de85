// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What rig.conf sets real sources to; see source_setup.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "source_setup.h"

/* A group that is there and is one; NULL without it. */
static int group_of(const config_setting_t *root, const char *name, const char *path,
		    const char *const *keys, const config_setting_t **group,
		    struct incise_error *err)
{
	*group = config_setting_get_member(root, name);
	if (!*group)
		return 0;
	if (!config_setting_is_group(*group))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: %s: expected a group { key = value; }; "
			"correct it",
			path, config_setting_source_line(*group), name);
	return incise_conf_known(*group, path, keys, err);
}

/* One of some words; *value is its place in @words, and as it was where the key is absent. */
static int read_word(const config_setting_t *group, const char *path, const char *key,
		     const char *const *words, int *value, struct incise_error *err)
{
	const char *word = NULL;
	char known[100] = "";
	int rc = incise_conf_string(group, path, key, &word, err);

	if (rc || !word)
		return rc;
	for (int i = 0; words[i]; i++) {
		if (!strcmp(word, words[i])) {
			*value = i;
			return 0;
		}
		snprintf(known + strlen(known), sizeof(known) - strlen(known), "%s%s",
			 i ? ", " : "", words[i]);
	}
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: %s.%s: expected one of %s, found \"%.40s\"; "
		"correct it",
		path, config_setting_source_line(config_setting_get_member(group, key)),
		config_setting_name(group), key, known, word);
}

/* stations = [1, 2]: of 1 … 4, ascending. */
static int read_stations(struct incise_tracker_setup *setup,
			 const config_setting_t *group, const char *path,
			 struct incise_error *err)
{
	const config_setting_t *list = config_setting_get_member(group, "stations");
	int n = list && config_setting_is_aggregate(list) &&
				!config_setting_is_group(list)
			? config_setting_length(list)
			: 0;
	bool good = n >= 1 && n <= 4;

	if (!list)
		return 0;
	for (int i = 0; i < n && good; i++) {
		const config_setting_t *one = config_setting_get_elem(list, i);
		int station = config_setting_type(one) == CONFIG_TYPE_INT
				      ? config_setting_get_int(one)
				      : 0;

		good = station >= 1 && station <= 4 &&
		       (!i || station > setup->stations[i - 1]);
		setup->stations[i] = (uint8_t)station;
	}
	setup->n_stations = n;
	if (good)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: tracker_setup.stations: expected numbers of 1 to "
		"4, ascending, such as [1]; correct it",
		path, config_setting_source_line(list));
}

int incise_tracker_setup_read(struct incise_tracker_setup *setup,
			      const config_setting_t *root, const char *path,
			      struct incise_error *err)
{
	static const char *const keys[] = {"stations", "hemisphere", "sync", "tip_mm",
					   NULL};
	static const char *const syncs[] = {"internal", "external", "video", NULL};
	const config_setting_t *group;
	int sync = INCISE_TRACKER_INTERNAL;
	int rc = group_of(root, "tracker_setup", path, keys, &group, err);

	*setup = (struct incise_tracker_setup){
		.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};
	if (rc || !group)
		return rc;
	rc = read_stations(setup, group, path, err);
	if (!rc)
		rc = incise_conf_direction(group, path, "hemisphere", setup->hemisphere,
					   err);
	if (!rc)
		rc = read_word(group, path, "sync", syncs, &sync, err);
	setup->sync = (enum incise_tracker_sync)sync;
	return rc ? rc : incise_conf_vector(group, path, "tip_mm", setup->tip_mm, err);
}

int incise_force_setup_read(struct incise_force_setup *setup,
			    const config_setting_t *root, const char *path,
			    struct incise_error *err)
{
	static const char *const keys[] = {"rate_hz", "channel", "full_scale_V",
					   "trigger", NULL};
	const config_setting_t *group;
	const char *trigger = NULL;
	int rc = group_of(root, "force_setup", path, keys, &group, err);

	*setup = (struct incise_force_setup){.rate_hz = 10000};
	if (rc || !group)
		return rc;
	rc = incise_conf_number(group, path, "rate_hz", 1, 100000, &setup->rate_hz, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "channel", 0, 255, &setup->channel,
					 err);
	if (!rc)
		rc = incise_conf_number(group, path, "full_scale_V", 1e-6, 1000,
					&setup->full_scale_V, err);
	if (!rc)
		rc = incise_conf_string(group, path, "trigger", &trigger, err);
	if (rc || !trigger)
		return rc;
	if (strlen(trigger) >= sizeof(setup->trigger) || strchr(trigger, '/'))
		return incise_error_set(
			err, EINVAL,
			"%.200s:%d: force_setup.trigger: expected the name of a trigger of "
			"at most %zu letters, without a slash; correct it",
			path,
			config_setting_source_line(
				config_setting_get_member(group, "trigger")),
			sizeof(setup->trigger) - 1);
	strcpy(setup->trigger, trigger);
	return 0;
}

int incise_camera_setup_read(struct incise_camera_setup *setup,
			     const config_setting_t *root, const char *path,
			     struct incise_error *err)
{
	static const char *const keys[] = {"width",	      "height",	     "rate_hz",
					   "format",	      "exposure_ms", "gain",
					   "white_balance_K", "focus",	     NULL};
	static const char *const formats[] = {"rgb", "grey", "yuyv", "mjpeg", NULL};
	const config_setting_t *group;
	int pixels = INCISE_PIXELS_YUYV;
	int rc = group_of(root, "camera_setup", path, keys, &group, err);

	*setup = (struct incise_camera_setup){.pixels = INCISE_PIXELS_YUYV};
	if (rc || !group)
		return rc;
	rc = incise_conf_integer(group, path, "width", 16, 16384, &setup->width, err);
	if (!rc)
		rc = incise_conf_integer(group, path, "height", 16, 16384, &setup->height,
					 err);
	if (!rc)
		rc = incise_conf_number(group, path, "rate_hz", 0.1, 1000,
					&setup->rate_hz, err);
	if (!rc)
		rc = read_word(group, path, "format", formats, &pixels, err);
	if (!rc)
		rc = incise_conf_number(group, path, "exposure_ms", 0.001, 1000,
					&setup->exposure_ms, err);
	if (!rc)
		rc = incise_conf_number(group, path, "gain", 1, 1e6, &setup->gain, err);
	if (!rc)
		rc = incise_conf_number(group, path, "white_balance_K", 1000, 20000,
					&setup->white_balance_K, err);
	if (!rc)
		rc = incise_conf_number(group, path, "focus", 1, 1e6, &setup->focus, err);
	setup->pixels = (enum incise_pixels)pixels;
	return rc;
}

/* Whole numbers of 0 … @most, @n of them; *values as they were where the key is absent. */
static int read_numbers(const config_setting_t *group, const char *path, const char *key,
			int n, int most, int *values, const char *form,
			struct incise_error *err)
{
	const config_setting_t *list = config_setting_get_member(group, key);
	bool good = list && config_setting_is_aggregate(list) &&
		    !config_setting_is_group(list) && config_setting_length(list) == n;
	int number[4] = {0};

	if (!list)
		return 0;
	for (int i = 0; i < n && good; i++) {
		const config_setting_t *one = config_setting_get_elem(list, i);

		number[i] = config_setting_get_int(one);
		good = config_setting_type(one) == CONFIG_TYPE_INT && number[i] >= 0 &&
		       number[i] <= most;
	}
	if (good) {
		memcpy(values, number, n * sizeof(*values));
		return 0;
	}
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: vision.%s: expected %s of whole numbers from 0 to %d; "
		"correct it",
		path, config_setting_source_line(list), key, form, most);
}

/* [low, high], the lower one first unless it @wraps around. */
static int read_range(const config_setting_t *group, const char *path, const char *key,
		      int most, bool wraps, int range[2], struct incise_error *err)
{
	int rc = read_numbers(group, path, key, 2, most, range, "[low, high]", err);

	if (rc || wraps || range[0] <= range[1])
		return rc;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: vision.%s: expected the lower number first; correct it", path,
		config_setting_source_line(config_setting_get_member(group, key)), key);
}

/* All of roi or nothing; what is smaller than a picture may be shows no handle. */
static int read_roi(const config_setting_t *group, const char *path,
		    struct incise_vision_box *roi, struct incise_error *err)
{
	int box[4] = {0};
	int rc = read_numbers(group, path, "roi", 4, 8192, box, "[x, y, width, height]",
			      err);

	*roi = (struct incise_vision_box){box[0], box[1], box[2], box[3]};
	if (rc || !config_setting_get_member(group, "roi") ||
	    (roi->width >= 16 && roi->height >= 16))
		return rc;
	return incise_error_set(
		err, EINVAL,
		"%.200s:%d: vision.roi: expected a width and a height of 16 or more; "
		"correct it",
		path,
		config_setting_source_line(config_setting_get_member(group, "roi")));
}

int incise_vision_setup_read(struct incise_vision_setup *setup, bool *given,
			     const config_setting_t *root, const char *path,
			     struct incise_error *err)
{
	static const char *const keys[] = {"hue",     "saturation", "value",
					   "full_px", "roi",	    NULL};
	const config_setting_t *group;
	int rc = group_of(root, "vision", path, keys, &group, err);

	*given = group;
	*setup = (struct incise_vision_setup){
		.hue = {0, 179}, .saturation = {0, 255}, .value = {0, 60}};
	if (rc || !group)
		return rc;
	rc = read_range(group, path, "hue", 179, true, setup->hue, err);
	if (!rc)
		rc = read_range(group, path, "saturation", 255, false, setup->saturation,
				err);
	if (!rc)
		rc = read_range(group, path, "value", 255, false, setup->value, err);
	if (!rc)
		rc = incise_conf_number(group, path, "full_px", 16, 8192, &setup->full_px,
					err);
	return rc ? rc : read_roi(group, path, &setup->roi, err);
}
