/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The keys of a rig.conf or a scene as a report: value, unit, and where each is from.
 */
#ifndef CLI_KEYS_H
#define CLI_KEYS_H

#include <stdbool.h>
#include <jansson.h>
#include <incise/settings.h>

struct keys {
	struct incise_key *key;
	size_t n;
};

/* For incise_rig_keys() and incise_scene_keys(), with a struct keys; keys->key is to be freed. */
int keys_add(void *keys, const struct incise_key *key);

/* Print those that are given in the file @path, or also the defaults. */
void keys_print(const struct keys *keys, const char *path, bool all);

/* The same as an array. */
json_t *keys_json(const struct keys *keys, const char *path, bool all);

#endif
