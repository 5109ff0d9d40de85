/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise demo --scene: paper 2 as pictures, a film and a strip of one procedure.
 */
#ifndef INCISE_DEMO_SCENE_H
#define INCISE_DEMO_SCENE_H

#include <stdbool.h>

/* Leave NAME.mkv and NAME.png in a folder, by `incise view`; fails the program. */
void demo_scene(const char *scene, const char *folder, bool force);

#endif
