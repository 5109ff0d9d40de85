/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading libconfig files strictly: every key is known, every number in its range, and
 * an error names file and line. Used by rig.conf, *.scene and calibration.conf.
 */
#ifndef INCISE_CONF_H
#define INCISE_CONF_H

#include <stdbool.h>
#include <libconfig.h>
#include <incise/error.h>

/* Parse a file. Returns 0 or a negative errno; on 0 the caller owes config_destroy(). */
int incise_conf_read(config_t *config, const char *path, struct incise_error *err);

/* The same of a text of @size bytes; @path names it in errors. */
int incise_conf_read_text(config_t *config, const char *path, char *text, size_t size,
			  struct incise_error *err);

/* Fail unless it is a group and every key of it is in the NULL-terminated list. */
int incise_conf_known(const config_setting_t *group, const char *path,
		      const char *const *keys, struct incise_error *err);

/*
 * Read a number if the key is there; integers are taken as numbers too. Returns 0 (value
 * untouched when the key is absent), -EINVAL (no number, or outside min … max).
 */
int incise_conf_number(const config_setting_t *group, const char *path, const char *key,
		       double min, double max, double *value, struct incise_error *err);

/* The same for a whole number. */
int incise_conf_integer(const config_setting_t *group, const char *path, const char *key,
			int min, int max, int *value, struct incise_error *err);

/* The same for true and false. */
int incise_conf_bool(const config_setting_t *group, const char *path, const char *key,
		     bool *value, struct incise_error *err);

/* Three numbers [x, y, z] of at most 1e6. */
int incise_conf_vector(const config_setting_t *group, const char *path, const char *key,
		       double value[3], struct incise_error *err);

/* At most @max finite numbers [a, b, …]; *@n is 0 where the key is absent. */
int incise_conf_numbers(const config_setting_t *group, const char *path, const char *key,
			double *values, int max, int *n, struct incise_error *err);

/* A direction [x, y, z] of length 1e-6 or more, made unit. */
int incise_conf_direction(const config_setting_t *group, const char *path,
			  const char *key, double value[3], struct incise_error *err);

/* Fail if a required key is missing. */
int incise_conf_need(const config_setting_t *group, const char *path, const char *key,
		     struct incise_error *err);

/* Read a string if the key is there; it lives as long as the config. */
int incise_conf_string(const config_setting_t *group, const char *path, const char *key,
		       const char **value, struct incise_error *err);

/* The same into @value of @size bytes, untouched when absent; fails where it is longer. */
int incise_conf_text(const config_setting_t *group, const char *path, const char *key,
		     char *value, size_t size, struct incise_error *err);

/*
 * Read `point_mm` and `normal` of the group `surface` within @group, if it is there; the
 * normal is made unit.
 */
int incise_conf_surface(const config_setting_t *group, const char *path,
			double point_mm[3], double normal[3], struct incise_error *err);

#endif
