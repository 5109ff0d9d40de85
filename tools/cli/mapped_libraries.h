/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The shared objects that a process has mapped, and the heavy libraries of incise that it
 * has not.
 */
#ifndef INCISE_MAPPED_LIBRARIES_H
#define INCISE_MAPPED_LIBRARIES_H

#include <jansson.h>
#include <sys/types.h>

/* File names, each once; empty if the process is gone. @pid 0: this process. */
json_t *mapped_libraries(pid_t pid);

/* Names of the heavy libraries that are not in such a list. */
json_t *unmapped_libraries(const json_t *mapped);

#endif
