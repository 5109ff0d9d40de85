/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The numbers of a texture, as incise train and incise info print them. */
#ifndef TEXTURE_REPORT_H
#define TEXTURE_REPORT_H

#include <incise/texture.h>
#include "json.h"

void texture_print(const struct incise_texture *texture);

/* NULL: null. */
json_t *texture_json(const struct incise_texture *texture);

#endif
