/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Runs the loop in a thread of its own, and looks after it from a normal one: log, state
 * page, service manager, watchdog, another scene at SIGHUP.
 */
#ifndef INCISE_HAPTIC_SUPERVISOR_H
#define INCISE_HAPTIC_SUPERVISOR_H

#include "haptic.h"

/*
 * Until the loop ends. The actuator is to be powered; scene and plan may be others than
 * before afterwards.
 *
 * Returns what incise_loop_run() did, or a negative errno when the loop could not begin.
 */
int haptic_supervise(struct haptic *haptic, struct incise_error *err);

/*
 * From here on SIGHUP means another look at the scene, where this process has no terminal
 * that could have been closed.
 */
void haptic_catch_reload(void);

#endif
