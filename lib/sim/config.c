// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Configuration of the virtual rig: names, defaults and ranges; see incise/sim.h. The ranges
 * keep every division, buffer and integration of the rig well defined.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "sim.h"

enum key_type { KEY_DOUBLE, KEY_INT, KEY_UINT64 };

struct key {
	const char *name;
	enum key_type type;
	size_t offset;
	int length; /* of an array; 0 for a single number */
	double init, min, max;
	const char *const *words; /* two, for 0 and 1; NULL: it takes numbers */
};

#define KEY(type, field, init, min, max)                                               \
	{                                                                              \
#field, type, offsetof(struct incise_sim_config, field), 0, init, min, \
			max, NULL                                                      \
	}
#define ARRAY(type, field, min, max)                                     \
	{                                                                \
#field, type, offsetof(struct incise_sim_config, field), \
			INCISE_SIM_DEPTHS_MAX, NAN, min, max, NULL       \
	}

static const char *const withdrawals[] = {"dissipative", "paper"};

static const struct key keys[] = {
	/* libconfig reads no larger integers without a suffix. */
	KEY(KEY_UINT64, seed, 1, 0, 2147483647.0),
	KEY(KEY_INT, motion, 0, 0, 3),
	KEY(KEY_DOUBLE, cone_deg, 80, 0, 170),
	ARRAY(KEY_DOUBLE, depth_mm, 0.1, 40),
	ARRAY(KEY_INT, times, 1, 1000),
	KEY(KEY_DOUBLE, cut_s, 8, 0.5, 3600),
	KEY(KEY_DOUBLE, pause_s, 1, 0.1, 3600),
	KEY(KEY_DOUBLE, speed_mm_s, 25, 0.1, 1000),
	KEY(KEY_DOUBLE, speed_swing, 0.9, 0, 0.95),
	KEY(KEY_DOUBLE, elastic1_N_mm, 0.045, 0, 100),
	KEY(KEY_DOUBLE, elastic2_N_mm2, 0.0028, 0, 10),
	KEY(KEY_DOUBLE, viscous, 0.35, 0, 10),
	KEY(KEY_DOUBLE, viscous_mm_s, 15, 0.01, 1000),
	KEY(KEY_DOUBLE, tooth, 0.2, 0, 0.9),
	KEY(KEY_DOUBLE, tooth_mm, 1.5, 0.01, 1000),
	KEY(KEY_DOUBLE, boundary, 0.1, 0, 0.3),
	KEY(KEY_DOUBLE, unloading_N_mm, 0.25, 0.01, 1000),
	KEY(KEY_DOUBLE, friction, 0.1, 0, 1),
	{"withdrawal", KEY_INT, offsetof(struct incise_sim_config, withdrawal), 0, 0, 0,
	 1, withdrawals},
	KEY(KEY_DOUBLE, tracker_hz, 120, 1, 1000),
	KEY(KEY_DOUBLE, tracker_noise_mm, 0.02, 0, 10),
	KEY(KEY_DOUBLE, tracker_latency_ms, 4.2, 0, 1000),
	KEY(KEY_DOUBLE, tracker_jitter_ms, 0.2, 0, 100),
	KEY(KEY_DOUBLE, tracker_drift_ppm, 50, -10000, 10000),
	KEY(KEY_DOUBLE, tip_x_mm, 0, -1000, 1000),
	KEY(KEY_DOUBLE, tip_y_mm, 0, -1000, 1000),
	KEY(KEY_DOUBLE, tip_z_mm, 0, -1000, 1000),
	KEY(KEY_DOUBLE, tube_s, 0, 0, 3600),
	KEY(KEY_DOUBLE, tube_x_mm, 20, -1000, 1000),
	KEY(KEY_DOUBLE, tube_y_mm, 0, -1000, 1000),
	KEY(KEY_DOUBLE, tube_above_mm, 200, 0, 1000),
	KEY(KEY_DOUBLE, tube_below_mm, 10, 0, 1000),
	KEY(KEY_DOUBLE, force_hz, 10000, 1, 200000),
	KEY(KEY_DOUBLE, force_mV_N, 1240, 1, 100000),
	KEY(KEY_DOUBLE, force_zero_mV, 180, -10000, 10000),
	KEY(KEY_DOUBLE, force_noise_mV, 3, 0, 1000),
	KEY(KEY_DOUBLE, force_delay_ms, 0, 0, 1000),
	KEY(KEY_DOUBLE, force_jitter_ms, 0, 0, 10),
	KEY(KEY_DOUBLE, camera_hz, 50, 1, 500),
	/* The lower limit keeps the whole scalpel in the frame; see sim_camera.c. */
	KEY(KEY_DOUBLE, camera_mm_px, 47.5 / 400, 0.118, 1),
	KEY(KEY_INT, axes, 1, 1, 3),
	KEY(KEY_DOUBLE, spring_N_mm, 2, 0.001, 1000),
	KEY(KEY_DOUBLE, lead_mm, 2, 0.1, 100),
	KEY(KEY_INT, steps_per_turn, 3200, 4, 1000000),
	KEY(KEY_DOUBLE, travel_mm, 20, 0.1, 1000),
	KEY(KEY_DOUBLE, screw_mm_s, 30, 0.1, 10000),
	KEY(KEY_DOUBLE, screw_mm_s2, 3000, 1, 1e7),
	KEY(KEY_DOUBLE, handle_kg, 0.05, 0.001, 100),
	KEY(KEY_DOUBLE, handle_friction_N, 0.01, 0, 100),
	KEY(KEY_DOUBLE, hand_N_mm, 1, 0, 1000),
	/* Some damping is needed to absorb the work of the moving nut. */
	KEY(KEY_DOUBLE, hand_N_s_mm, 0.01, 0.0001, 10),
	KEY(KEY_INT, bench, 0, 0, 1),
	KEY(KEY_DOUBLE, backlash_mm, 0, 0, 10),
	KEY(KEY_DOUBLE, hysteresis_N, 0, 0, 10),
	KEY(KEY_DOUBLE, stiction_N, 0, 0, 10),
	KEY(KEY_DOUBLE, stall_mm_s, 0, 0, 10000),
};

#define N_KEYS (sizeof(keys) / sizeof(keys[0]))

static double key_get(const struct incise_sim_config *config, const struct key *key,
		      int index)
{
	const char *field = (const char *)config + key->offset;

	switch (key->type) {
	case KEY_INT:
		return ((const int *)field)[index];
	case KEY_UINT64:
		return (double)((const uint64_t *)field)[index];
	default:
		return ((const double *)field)[index];
	}
}

static void key_put(struct incise_sim_config *config, const struct key *key, int index,
		    double value)
{
	char *field = (char *)config + key->offset;

	switch (key->type) {
	case KEY_INT:
		((int *)field)[index] = (int)value;
		break;
	case KEY_UINT64:
		((uint64_t *)field)[index] = (uint64_t)value;
		break;
	default:
		((double *)field)[index] = value;
		break;
	}
}

static int key_check(const struct key *key, double value, int code,
		     struct incise_error *err)
{
	bool whole = key->type != KEY_DOUBLE;

	if (value >= key->min && value <= key->max && (!whole || value == floor(value)))
		return 0;
	return incise_error_set(err, code,
				"sim.%s: expected a %s from %.10g to %.10g, found %.10g; "
				"correct it",
				key->name, whole ? "whole number" : "number", key->min,
				key->max, value);
}

void incise_sim_config_init(struct incise_sim_config *config)
{
	/* Song et al. (2006), §3. */
	*config = (struct incise_sim_config){
		.n_depths = 4,
		.depth_mm = {5, 10, 15, 20},
		.times = {3, 4, 4, 3},
	};
	for (size_t i = 0; i < N_KEYS; i++)
		if (!keys[i].length)
			key_put(config, &keys[i], 0, keys[i].init);
}

static const struct key *key_find(const char *name, size_t length)
{
	for (size_t i = 0; i < N_KEYS; i++)
		if (strlen(keys[i].name) == length &&
		    !strncmp(name, keys[i].name, length))
			return &keys[i];
	return NULL;
}

bool incise_sim_config_has_words(const char *name)
{
	const struct key *key = key_find(name, strlen(name));

	return key && key->words;
}

int incise_sim_config_set_word(struct incise_sim_config *config, const char *name,
			       const char *word, struct incise_error *err)
{
	const struct key *key = key_find(name, strlen(name));

	for (int i = 0; i < 2; i++)
		if (!strcmp(word, key->words[i])) {
			key_put(config, key, 0, i);
			return 0;
		}
	return incise_error_set(err, EINVAL,
				"sim.%s: expected %s or %s, found %.40s; correct it",
				name, key->words[0], key->words[1], word);
}

static int unknown_key(const char *name, struct incise_error *err)
{
	const char *names[N_KEYS + 1] = {NULL}, *nearest;

	for (size_t i = 0; i < N_KEYS; i++)
		names[i] = keys[i].name;
	nearest = incise_nearest_name(name, names);
	if (nearest)
		return incise_error_set(err, ENOENT,
					"sim.%.60s: unknown key; did you mean %s?", name,
					nearest);
	return incise_error_set(err, ENOENT,
				"sim.%.60s: unknown key; rig.conf(5) lists them", name);
}

bool incise_sim_config_has(const char *name)
{
	return key_find(name, strcspn(name, "["));
}

int incise_sim_config_set(struct incise_sim_config *config, const char *name,
			  double value, struct incise_error *err)
{
	size_t length = strcspn(name, "[");
	const struct key *key = key_find(name, length);
	int index = 0;
	char *end;
	int rc;

	if (!key)
		return unknown_key(name, err);
	if (name[length]) {
		long number = strtol(name + length + 1, &end, 10);

		if (!key->length)
			return incise_error_set(err, ENOENT,
						"sim.%.60s: %s is a single number; "
						"remove the index",
						name, key->name);
		if (strcmp(end, "]") || number < 0 || number >= key->length)
			return incise_error_set(
				err, ENOENT,
				"sim.%.60s: expected an index from [0] to [%d]; "
				"correct it",
				name, key->length - 1);
		index = (int)number;
	}
	rc = key_check(key, value, EINVAL, err);
	if (rc)
		return rc;
	key_put(config, key, index, value);
	if (key->length) {
		/* Without an index it becomes the only depth. */
		if (!name[length])
			config->n_depths = 1;
		else if (config->n_depths <= index)
			config->n_depths = index + 1;
	}
	return 0;
}

int incise_sim_config_get(const struct incise_sim_config *config, int i,
			  const char **name, double values[INCISE_SIM_DEPTHS_MAX],
			  const char **word)
{
	int n;

	if (i < 0 || i >= (int)N_KEYS)
		return 0;
	n = keys[i].length ? config->n_depths : 1;
	*name = keys[i].name;
	for (int j = 0; j < n; j++)
		values[j] = key_get(config, &keys[i], j);
	*word = keys[i].words ? keys[i].words[(int)values[0]] : NULL;
	return n;
}

int incise_sim_config_check(const struct incise_sim_config *config,
			    struct incise_error *err)
{
	int rc;

	if (config->n_depths < 1 || config->n_depths > INCISE_SIM_DEPTHS_MAX)
		return incise_error_set(
			err, EINVAL,
			"sim.depth_mm: expected 1 to %d depths, found %d; "
			"correct it",
			INCISE_SIM_DEPTHS_MAX, config->n_depths);
	for (size_t i = 0; i < N_KEYS; i++) {
		int n = keys[i].length ? config->n_depths : 1;

		for (int j = 0; j < n; j++) {
			rc = key_check(&keys[i], key_get(config, &keys[i], j), EINVAL,
				       err);
			if (rc)
				return rc;
		}
	}
	return 0;
}
