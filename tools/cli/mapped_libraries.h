/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The shared objects that a process has mapped, and which of the well-known heavy ones that
 * incise uses somewhere it has not.
 */
#ifndef INCISE_MAPPED_LIBRARIES_H
#define INCISE_MAPPED_LIBRARIES_H

#include <jansson.h>
#include <sys/types.h>

/* Names of files, each once; empty when the process is gone. @pid: 0 for this one. */
json_t *mapped_libraries(pid_t pid);

/* Names of the heavy ones that are not in such a list. */
json_t *unmapped_libraries(const json_t *mapped);

#endif
