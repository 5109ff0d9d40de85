/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * libconfig files and errors of them, which name file, line and key. Their values are read by
 * settings.h.
 */
#ifndef INCISE_CONF_H
#define INCISE_CONF_H

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
 * "PATH:LINE: GROUP.KEY: expected …, found VALUE; correct it" of a key, which may have its default, or of
 * the setting @group itself with the key NULL. Returns -EINVAL.
 */
int incise_conf_error(const config_setting_t *group, const char *key, const char *path,
		      struct incise_error *err, const char *fmt, ...) INCISE_PRINTF(5, 6);

/* "PATH:LINE: GROUP.KEY: missing; add it". Returns -EINVAL. */
int incise_conf_missing(const config_setting_t *group, const char *path, const char *key,
			struct incise_error *err);

/* The line of a setting; for a group in a list, the line of its first key. */
int incise_conf_line(const config_setting_t *setting);

#endif
