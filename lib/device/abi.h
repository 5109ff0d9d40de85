/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The kernel module's ABI beside the library's own names: two of its structs are called
 * like public ones of incise/stepper.h and are incise_abi_… here. The thread over GPIO
 * uses the same pages and configuration.
 */
#ifndef INCISE_ABI_H
#define INCISE_ABI_H

#define incise_stepper_info incise_abi_info
#define incise_stepper_status incise_abi_status
#include "../../driver/uapi/incise_stepper.h"

/* The numbers of requests hold the structs' sizes: before they get their names back. */
static const unsigned long INCISE_ABI_GET_INFO = INCISE_STEPPER_GET_INFO;

#undef incise_stepper_info
#undef incise_stepper_status
#undef INCISE_STEPPER_GET_INFO

#endif
