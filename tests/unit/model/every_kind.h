/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A .fis file with every kind of function, weights, a free input and min for AND. */
#ifndef INCISE_TEST_EVERY_KIND_H
#define INCISE_TEST_EVERY_KIND_H

static const char every_kind[] =
	"[System]\nName='every kind'\nType='sugeno'\nNumInputs=2\nNumOutputs=1\n"
	"NumRules=4\nAndMethod='min'\nDefuzzMethod='wtaver'\n"
	"[Input1]\nName='a'\nRange=[0 10]\nNumMFs=4\nMF1='low':'trimf',[0 0 4]\n"
	"MF2='mid':'trapmf',[2 4 6 8]\nMF3='up':'sigmf',[2 7]\n"
	"MF4='two':'gauss2mf',[1 4 2 5]\n"
	"[Input2]\nName='b'\nRange=[0 1]\nNumMFs=2\nMF1='g':'gaussmf',[0.5 0]\n"
	"MF2='e':'gbellmf',[0.5 2 1]\n"
	"[Output1]\nName='y'\nRange=[0 1]\nNumMFs=2\nMF1='c':'constant',[1]\n"
	"MF2='l':'linear',[1 2 3]\n"
	"[Rules]\n1 1, 1 (1) : 1\n2 2, 2 (0.25) : 1\n3 0, 1 (0) : 1\n4 0, 2 (1) : 2\n";

#endif
