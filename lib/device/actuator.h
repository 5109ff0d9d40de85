/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading the group `actuator` of rig.conf; see incise/backend.h.
 */
#ifndef INCISE_ACTUATOR_CONF_H
#define INCISE_ACTUATOR_CONF_H

#include <incise/backend.h>
#include "../base/conf.h"

/* Read and check the group. 0 or -EINVAL; @err names file, line and key. */
int incise_actuator_read(struct incise_actuator *actuator, const config_setting_t *group,
			 const char *path, struct incise_error *err);

#endif
