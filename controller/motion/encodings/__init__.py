"""Encodings: conversion between clips and the channels of a network."""
