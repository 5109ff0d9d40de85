/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Settings: each key of rig.conf, of a scene, of calibration.conf and of a "sim:" string is one row of
 * a table. Rows are read, printed, and made into the tables of the manual pages here, once.
 *
 *   #define SETTINGS_OF struct incise_scene
 *   static const struct incise_setting limits[] = {
 *           SETTING_NUMBER(force_N, limits.force_N, "N", 0.01, 100, "4", "largest commanded force"),
 *           {0},
 *   };
 */
#ifndef INCISE_SETTINGS_H
#define INCISE_SETTINGS_H

#include <stddef.h>
#include <stdint.h>
#include <incise/settings.h>
#include "conf.h"

#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

enum incise_setting_kind {
	SETTING_IS_NUMBER, /* one, or as many as the member has */
	SETTING_IS_WHOLE,
	SETTING_IS_DIRECTION, /* made unit */
	SETTING_IS_TRUTH,
	SETTING_IS_WORD, /* the member is its index in .words */
	SETTING_IS_TEXT,
	SETTING_IS_GROUP, /* of .rows, whose members are in the same struct */
	SETTING_IS_OWN,	  /* read by its owner; by .read if that is there */
};

enum incise_setting_store {
	SETTING_STORES_DOUBLE,
	SETTING_STORES_INT, /* and enums, and structs of int */
	SETTING_STORES_U8,
	SETTING_STORES_U32,
	SETTING_STORES_U64,
	SETTING_STORES_BOOL,
	SETTING_STORES_CHARS,
	SETTING_STORES_POINTER, /* to the text, which lives as long as the file's config_t */
};

struct incise_setting {
	const char *key;
	enum incise_setting_kind kind;
	const char *unit; /* or "" */
	double min, max;  /* of each number */
	/*
	 * As a file has it. In parentheses: no value: in words for the page, or the owner's meaning of
	 * 0; SETTING_REQUIRED: the key must be there.
	 */
	const char *initial;
	const char *help; /* for the page: one sentence, plain text in UTF-8 */
	size_t offset, size;
	enum incise_setting_store store;
	double scale; /* the member in the unit of the key; 0: 1 */
	size_t count; /* offset of the int that counts the numbers, or 0: all */
	const char *const *words; /* ends with NULL */
	const struct incise_setting *rows;
	/* A row of another kind than SETTING_IS_OWN reads by it values that do not fit. */
	int (*read)(void *to, const config_setting_t *setting, const char *path,
		    struct incise_error *err);
	/* A further condition of a value, given its numbers or its text; and the condition in words. */
	bool (*fits)(const double *number, int n, const char *text);
	const char *expected;
};

#define SETTING_REQUIRED "(required)"
/* Most numbers of a setting: a covariance of 16. */
#define SETTING_NUMBERS_MAX 136
/* Most rows of a table. */
#define SETTING_ROWS_MAX 64
/* Bytes of a value as text. */
#define SETTING_TEXT_MAX 400

#define SETTING_AT(member) \
	.offset = offsetof(SETTINGS_OF, member),         \
	.size = sizeof(((SETTINGS_OF *)0)->member),      \
	.store = _Generic(((SETTINGS_OF *)0)->member,    \
		double: SETTING_STORES_DOUBLE,           \
		double *: SETTING_STORES_DOUBLE,         \
		uint8_t: SETTING_STORES_U8,              \
		uint8_t *: SETTING_STORES_U8,            \
		uint32_t: SETTING_STORES_U32,            \
		uint64_t: SETTING_STORES_U64,            \
		bool: SETTING_STORES_BOOL,               \
		char *: SETTING_STORES_CHARS,            \
		const char *: SETTING_STORES_POINTER,    \
		default: SETTING_STORES_INT)

/* Rows; behind the help there may be more, such as .scale = 1e-3. */
#define SETTING_ROW(is, key, member, unit, min, max, initial, help, ...)                 \
	{                                                                                \
#key, is, unit, min, max, initial, help, SETTING_AT(member), __VA_ARGS__ \
	}
#define SETTING_NUMBER(key, member, ...) \
	SETTING_ROW(SETTING_IS_NUMBER, key, member, __VA_ARGS__)
#define SETTING_WHOLE(key, member, ...) \
	SETTING_ROW(SETTING_IS_WHOLE, key, member, __VA_ARGS__)
#define SETTING_VECTOR(key, member, unit, ...) \
	SETTING_NUMBER(key, member, unit, -1e6, 1e6, __VA_ARGS__)
#define SETTING_DIRECTION(key, member, ...) \
	SETTING_ROW(SETTING_IS_DIRECTION, key, member, "", -1e6, 1e6, __VA_ARGS__)
#define SETTING_TRUTH(key, member, ...) \
	SETTING_ROW(SETTING_IS_TRUTH, key, member, "", 0, 1, __VA_ARGS__)
#define SETTING_WORD(key, member, of, initial, help) \
	SETTING_ROW(SETTING_IS_WORD, key, member, "", 0, 0, initial, help, .words = (of))
#define SETTING_TEXT(key, member, ...) \
	SETTING_ROW(SETTING_IS_TEXT, key, member, "", 0, 0, __VA_ARGS__)
#define SETTING_GROUP(key, of, help)                                     \
	{                                                                \
#key, SETTING_IS_GROUP, "", 0, 0, "", help, .rows = (of) \
	}
#define SETTING_OWN(key, unit, initial, help, ...)                           \
	{                                                                    \
#key, SETTING_IS_OWN, unit, 0, 0, initial, help, __VA_ARGS__ \
	}

/* Set the members of all rows that have a default, also in groups. */
void incise_settings_init(const struct incise_setting *rows, void *to);

/*
 * Read a group of a file, strictly: every key has a row, and every value its kind and range. NULL:
 * nothing. Returns 0; -EINVAL, -ENOMEM or the errno of a .read; then some members are set.
 */
int incise_settings_read(const struct incise_setting *rows, const config_setting_t *group,
			 const char *path, void *to, struct incise_error *err);

/*
 * Set one key by text without quotes, "0.5", "paper", for messages "sim.KEY: …" where @group is "sim".
 * KEY[2] is an element of numbers that are counted, and KEY the only one.
 * Returns 0; -ENOENT (no such key), -EINVAL.
 */
int incise_settings_set(const struct incise_setting *rows, const char *group,
			const char *key, const char *text, void *to,
			struct incise_error *err);

/* Whether all members are values that a file may set. Returns 0 or -EINVAL. */
int incise_settings_check(const struct incise_setting *rows, const char *group,
			  const void *of, struct incise_error *err);

/* The row of a key, or NULL. */
const struct incise_setting *incise_setting_of(const struct incise_setting *rows,
					       const char *key);

/* A list of keys with their values that is under way. */
struct incise_settings_list {
	incise_key_found *found;
	void *context;
	int rc; /* last return of @found; after another than 0 it is not called again */
};

/*
 * List a table: for each row but groups, the key as PREFIX.KEY, and its value in @of, or of a row of the
 * owner as @group has it; the key is given if @group (or NULL) has it.
 */
void incise_settings_list(struct incise_settings_list *list,
			  const struct incise_setting *rows, const void *of,
			  const config_setting_t *group, const char *prefix);

/* One key of it with the value @text; @row: of its unit and help; @setting: where it is given, or NULL. */
void incise_settings_put(struct incise_settings_list *list,
			 const struct incise_setting *row,
			 const config_setting_t *setting, const char *prefix,
			 const char *name, const char *text);

/* The value as a file has it; "" without a value. */
void incise_setting_text(const struct incise_setting *row, const void *of, char *text,
			 size_t size);

/* A text in quotes, as a file has it. */
void incise_setting_quoted(const char *from, char *text, size_t size);

/* The keys of calibration.conf, in a struct incise_calibration. */
extern const struct incise_setting incise_calibration_settings[];

#endif
